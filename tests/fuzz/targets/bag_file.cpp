// A number that says what the bytes are: a bag's .db3 file, its metadata.yaml beside a sound .db3,
// or a compressed message or file.

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/bag_scan_source.hpp"
#include "idl/bag/cdr_reader.hpp"
#include "idl/bag/zstd_decompression.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/memory_folder.hpp"
#include "tests/idl/bag_fixture.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace bag_file_inputs {
namespace {

namespace fs = std::filesystem;

enum Kind : std::uint8_t { database, metadata, compressed, compressed_file, kinds };

/// As `stillmap replay` reads it; scans that are damaged are left out.
void read_all(const fs::path& bag) {
  const dds::BagScanSource scans(bag, "");
  for (std::size_t i = 0; i < scans.size(); ++i) {
    try {
      static_cast<void>(scans.read(i));
    } catch (const DatasetError&) {
    }
  }
}

/// A bag of two messages on one topic.
const fs::path& sound_bag() {
  static const fs::path folder = [] {
    const fs::path path = MemoryFolder::of_this_process().path("sound_bag");
    fs::remove_all(path);
    dds::write_bag(path, {dds::bag_message(0), dds::bag_message(1)});
    return path;
  }();
  return folder;
}

fs::path sound_database() {
  for (const auto& entry : fs::directory_iterator(sound_bag())) {
    if (entry.path().extension() == ".db3") return entry.path();
  }
  throw std::logic_error("a bag has a .db3 file");
}

void read(Kind kind, Bytes bytes) {
  const auto& folder = MemoryFolder::of_this_process();
  if (kind == database) {
    folder.remove("alone.db3");
    return read_all(folder.file("alone.db3", bytes));
  }
  if (kind == metadata) {
    static const std::string content = content_of(sound_database());
    folder.file("bag/metadata.yaml", bytes);
    folder.file("bag/" + sound_database().filename().string(), content);
    return read_all(folder.path("bag"));
  }
  if (kind == compressed) {
    static_cast<void>(dds::decompressed(bytes));
  } else {
    dds::decompress_file(folder.file("packed.zstd", bytes), folder.path("plain"));
  }
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const auto kind = static_cast<Kind>(source.byte() % kinds);
  try {
    read(kind, source.rest());
  } catch (const DatasetError&) {
  } catch (const dds::CdrError&) {
  }
}

std::vector<Seed> seeds() {
  // zstd: one frame with the single raw block "hi", its size given.
  const std::string frame("\x28\xb5\x2f\xfd\x20\x02\x11\x00\x00hi", 11);
  return {{"database", with_choice(database, content_of(sound_database()))},
          {"metadata", with_choice(metadata, content_of(sound_bag() / "metadata.yaml"))},
          {"compressed", with_choice(compressed, frame)},
          {"compressed_file", with_choice(compressed_file, frame)}};
}

}  // namespace
}  // namespace bag_file_inputs

const Target bag_file_target{"bag_file", bag_file_inputs::run, bag_file_inputs::seeds};

}  // namespace stillmap::fuzz
