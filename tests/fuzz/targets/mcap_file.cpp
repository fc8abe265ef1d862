// An .mcap file.

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/bag_scan_source.hpp"
#include "idl/bag/cdr_reader.hpp"
#include "idl/bag/mcap_bag_file.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/memory_folder.hpp"
#include "tests/idl/bag_fixture.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace mcap_file_inputs {
namespace {

namespace fs = std::filesystem;

/// Every message of every topic; no more than so many, as an index may name one again and again.
void read_messages(const fs::path& path) {
  constexpr std::size_t max_messages = 200;
  const dds::McapBagFile file(path);
  for (const dds::BagTopic& topic : file.topics()) {
    std::size_t read = 0;
    for (const dds::BagMessage& message : file.messages(topic.name, 0)) {
      if (++read > max_messages) break;
      try {
        const auto begin = file.first_bytes(message, 12);
        const auto bytes = file.bytes(message);
        require(begin.size() <= 12 && begin.size() <= bytes.size() &&
                    std::equal(begin.begin(), begin.end(), bytes.begin()),
                "a message begins as it is");
      } catch (const dds::CdrError&) {
      }
    }
  }
}

/// As `stillmap replay` reads it.
void read_scans(const fs::path& path) {
  const dds::BagScanSource scans(path, "");
  for (std::size_t i = 0; i < std::min<std::size_t>(scans.size(), 20); ++i) {
    try {
      static_cast<void>(scans.read(i));
    } catch (const DatasetError&) {
    }
  }
  static_cast<void>(scans.imu());
}

void run(Bytes bytes) {
  const fs::path file = MemoryFolder::of_this_process().file("alone.mcap", bytes);
  for (const auto& read : {read_messages, read_scans}) {
    try {
      read(file);
    } catch (const DatasetError&) {
    }
  }
}

std::string written(dds::mcap::Compression compression) {
  const fs::path folder = MemoryFolder::of_this_process().path("sound_mcap");
  fs::remove_all(folder);
  dds::write_bag(folder, {dds::bag_message(0), dds::bag_message(1)}, dds::BagFormat::mcap,
                 compression);
  return content_of(folder / "sound_mcap_0.mcap");
}

/// Messages outside of chunks, and no summary.
std::string without_chunks() {
  using namespace dds::mcap;
  std::string file(magic);
  append_header(file, "ros2", "");
  append_schema(file, {.id = 1, .name = "sensor_msgs/msg/PointCloud2", .encoding = "", .text = ""});
  append_channel(
      file,
      {.id = 0, .schema_id = 1, .topic = "/points", .message_encoding = "cdr", .metadata = {}});
  append_message(file, {.channel_id = 0, .sequence = 1, .log_time_ns = 5, .publish_time_ns = 5},
                 dds::bag_message(0));
  append_data_end(file, 0);
  append_footer_start(file, {});
  append_number(file, 0);
  return file.append(magic);
}

std::vector<Seed> seeds() {
  using dds::mcap::Compression;
  const std::string plain = written(Compression::none);
  return {{"plain", plain},
          {"lz4", written(Compression::lz4)},
          {"zstd", written(Compression::zstd)},
          {"unfinished", plain.substr(0, plain.size() / 2)},
          {"without_chunks", without_chunks()}};
}

}  // namespace
}  // namespace mcap_file_inputs

const Target mcap_file_target{"mcap_file", mcap_file_inputs::run, mcap_file_inputs::seeds};

}  // namespace stillmap::fuzz
