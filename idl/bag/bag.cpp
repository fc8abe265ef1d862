#include "idl/bag/bag.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <optional>
#include <utility>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/file_stamp.hpp"
#include "idl/bag/mcap_bag_file.hpp"
#include "idl/bag/zstd_decompression.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

constexpr std::array bag_endings{".db3", ".db3.zstd", ".mcap", ".mcap.zstd"};

/// "bag_0.db3.zstd" is packed from "bag_0.db3".
fs::path unpacked_name(const fs::path& file) {
  return file.extension() == ".zstd" ? fs::path(file).replace_extension() : file;
}

/// All files of bags in a folder, "_2" before "_10", each before the same packed.
std::vector<fs::path> bag_files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().string();
    if (std::ranges::any_of(bag_endings, [&](const char* end) { return name.ends_with(end); }))
      files.push_back(entry.path());
  }
  std::ranges::sort(files, [](const fs::path& a, const fs::path& b) {
    const std::string part_a = unpacked_name(a).filename().string();
    const std::string part_b = unpacked_name(b).filename().string();
    return part_a == part_b ? a < b : natural_less(part_a, part_b);
  });
  return files;
}

/// Takes those of another storage than the first kind that there is out of `files`, and of a part
/// that lies there twice the packed one, which a killed recorder may not have finished.
std::vector<fs::path> take_out_other_bags(std::vector<fs::path>& files) {
  const bool is_sqlite = std::ranges::any_of(
      files, [](const fs::path& file) { return unpacked_name(file).extension() == ".db3"; });
  std::vector<fs::path> kept, others;
  for (fs::path& file : files) {
    const fs::path part = unpacked_name(file);
    const bool is_double = !kept.empty() && unpacked_name(kept.back()) == part;
    if (is_double) continue;
    ((part.extension() == ".db3") == is_sqlite ? kept : others).push_back(std::move(file));
  }
  files = std::move(kept);
  return others;
}

[[noreturn]] void refuse_ros_1(const fs::path& file) {
  throw DatasetError(file,
                     "is a bag of ROS 1, which is not read here: 'rosbags-convert --src BAG "
                     "--dst NEW_BAG' (Python package rosbags) makes one of ROS 2");
}

/// Other recordings may have a metadata.yaml of their own.
bool describes_a_bag(const fs::path& metadata) {
  std::ifstream in(metadata);
  std::string word;
  return in >> word && word.starts_with("rosbag2_bagfile_information");
}

std::unique_ptr<const BagFile> opened(const fs::path& file) {
  if (file.extension() == ".mcap") return std::make_unique<McapBagFile>(file);
  return std::make_unique<SqliteBagFile>(file);
}

/// Of the recorder: it packs a part once it is full, so that either may lie there.
fs::path packed_or_not(const fs::path& file) {
  std::error_code error;
  if (fs::exists(file, error)) return file;
  fs::path other = unpacked_name(file);
  if (other == file) other += ".zstd";
  return fs::exists(other, error) ? other : file;
}

bool is_of_ros_1(const BagTopic& topic) { return topic.serialization_format == "ros1"; }

}  // namespace

bool is_bag(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    if (describes_a_bag(path / "metadata.yaml")) return true;
    return !bag_files_in(path).empty();
  }
  const std::string name = path.string();
  return name.ends_with(".bag") ||
         std::ranges::any_of(bag_endings, [&](const char* end) { return name.ends_with(end); });
}

Bag::Bag(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error)) throw DatasetError(path, "no such file or folder; check the path");
  if (fs::is_directory(path, error)) {
    open(files_of_folder(path));
  } else {
    if (path.extension() == ".bag") refuse_ros_1(path);
    const fs::path metadata = path.parent_path() / "metadata.yaml";
    try {
      if (describes_a_bag(metadata)) compression_ = read_bag_metadata(metadata).compression;
    } catch (const DatasetError&) {
      // A file that is named by itself needs no description: it says what is in it.
    }
    open({path});
  }
}

std::vector<fs::path> Bag::files_of_folder(const fs::path& folder) {
  std::vector<fs::path> present = bag_files_in(folder);
  if (!describes_a_bag(folder / "metadata.yaml")) {
    if (present.empty()) throw DatasetError(folder, "holds no .db3 or .mcap file of a bag");
    for (const fs::path& other : take_out_other_bags(present)) {
      left_out_.push_back(other.string() +
                          " is left out: the .db3 files beside it are read; name "
                          "it by itself to read it");
    }
    return present;
  }
  const BagMetadata metadata = read_bag_metadata(folder / "metadata.yaml");
  compression_ = metadata.compression;
  std::vector<fs::path> files;
  files.reserve(metadata.files.size());
  for (const std::string& file : metadata.files) files.push_back(packed_or_not(folder / file));
  const auto is_named = [&](const fs::path& file) {
    return std::ranges::find(files, unpacked_name(file), unpacked_name) != files.end();
  };
  for (const fs::path& other : present) {
    if (is_named(other)) continue;
    left_out_.push_back(other.string() +
                        " is left out, as metadata.yaml does not name it: without metadata.yaml, "
                        "or after 'ros2 bag reindex', all files of the folder are read");
  }
  return files;
}

void Bag::open(const std::vector<fs::path>& files) {
  std::optional<DatasetError> fault;
  for (const fs::path& file : files) {
    try {
      open_file(file);
    } catch (const DatasetWriteError&) {
      // A full disk is no fault of the bag.
      throw;
    } catch (const DatasetError& error) {
      if (!fault) fault = error;
      left_out_.push_back(std::string("a part of the bag is left out: ") + error.what());
    }
  }
  if (files_.empty() && fault) throw DatasetError(*fault);
  if (!topics_.empty() && std::ranges::all_of(topics_, is_of_ros_1)) refuse_ros_1(files.front());
}

void Bag::open_file(const fs::path& file) {
  fs::path to_open = file;
  // The recorder packs a file once it is full: the last one may still be as it is.
  if (file.extension() == ".zstd") {
    if (!decompressed_) {
      try {
        decompressed_ = std::make_unique<TemporaryFolder>(
            fs::temp_directory_path() / "stillmap-bag-", TemporaryFolder::OfTheDead::remove);
      } catch (const fs::filesystem_error& error) {
        throw DatasetError(error.path1(),
                           "cannot be made; check the folder for temporary files (TMPDIR)");
      }
    }
    to_open = decompressed_->path() / file.stem();
    try {
      decompress_file(file, to_open);
    } catch (const DatasetError&) {
      std::error_code ignored;
      fs::remove(to_open, ignored);
      throw;
    }
  }
  auto part = opened(to_open);
  add_topics(*part);
  files_.push_back(std::move(part));
  names_.push_back(file);
}

void Bag::add_topics(const BagFile& file) {
  for (BagTopic& topic : file.topics()) {
    const auto known = std::ranges::find(topics_, topic.name, &BagTopic::name);
    if (known == topics_.end()) {
      topics_.push_back(std::move(topic));
    } else {
      known->messages += topic.messages;
    }
  }
}

std::vector<BagMessage> Bag::messages(const std::string& topic) const {
  std::vector<BagMessage> messages;
  for (std::size_t file = 0; file < files_.size(); ++file) {
    const auto of_file = files_[file]->messages(topic, file);
    messages.insert(messages.end(), of_file.begin(), of_file.end());
  }
  std::ranges::stable_sort(messages, {}, &BagMessage::received_ns);
  return messages;
}

std::vector<std::uint8_t> Bag::bytes(const BagMessage& message) const {
  std::vector<std::uint8_t> stored = files_.at(message.file)->bytes(message);
  const bool is_packed = compression_ == BagCompression::of_messages || is_zstd(stored);
  return is_packed ? decompressed(stored) : stored;
}

std::vector<std::uint8_t> Bag::first_bytes(const BagMessage& message, int bytes) const {
  if (compression_ == BagCompression::of_messages) return this->bytes(message);
  std::vector<std::uint8_t> first = files_.at(message.file)->first_bytes(message, bytes);
  return is_zstd(first) ? this->bytes(message) : first;
}

std::vector<std::string> Bag::faults() const {
  std::vector<std::string> faults = left_out_;
  for (std::size_t file = 0; file < files_.size(); ++file) {
    for (const std::string& fault : files_[file]->faults()) {
      faults.push_back(names_[file].string() + ": " + fault);
    }
  }
  return faults;
}

}  // namespace stillmap::dds
