#include "idl/bag/bag.hpp"

#include <algorithm>
#include <array>
#include <fstream>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/file_stamp.hpp"
#include "idl/bag/mcap_bag_file.hpp"

namespace stillmap::dds {
namespace {

namespace fs = std::filesystem;

constexpr std::array bag_endings{".db3", ".db3.zstd", ".mcap", ".mcap.zstd"};

/// Files of a folder with this ending, "_2" before "_10".
std::vector<fs::path> files_with(const fs::path& folder, std::string_view ending) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().string().ends_with(ending)) files.push_back(entry.path());
  }
  std::ranges::sort(files, [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  return files;
}

[[noreturn]] void refuse_ros_1(const fs::path& file) {
  throw DatasetError(file,
                     "is a bag of ROS 1, which is not read here: 'rosbags-convert --src BAG "
                     "--dst NEW_BAG' (Python package rosbags) makes one of ROS 2");
}

/// The files of a folder without metadata.
std::vector<fs::path> bag_files_in(const fs::path& folder) {
  for (const char* ending : bag_endings) {
    if (auto files = files_with(folder, ending); !files.empty()) return files;
  }
  throw DatasetError(folder, "holds no .db3 or .mcap file of a bag");
}

/// Other recordings may have a metadata.yaml of their own.
bool describes_a_bag(const fs::path& metadata) {
  std::ifstream in(metadata);
  std::string word;
  return in >> word && word.starts_with("rosbag2_bagfile_information");
}

std::unique_ptr<const BagFile> open_file(const fs::path& file) {
  if (file.extension() == ".mcap") return std::make_unique<McapBagFile>(file);
  return std::make_unique<SqliteBagFile>(file);
}

}  // namespace

bool is_bag(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    if (describes_a_bag(path / "metadata.yaml")) return true;
    return std::ranges::any_of(
        bag_endings, [&](const char* ending) { return !files_with(path, ending).empty(); });
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
  if (!describes_a_bag(folder / "metadata.yaml")) return bag_files_in(folder);
  const BagMetadata metadata = read_bag_metadata(folder / "metadata.yaml");
  compression_ = metadata.compression;
  std::vector<fs::path> files;
  files.reserve(metadata.files.size());
  for (const std::string& file : metadata.files) files.push_back(folder / file);
  return files;
}

void Bag::open(const std::vector<fs::path>& files) {
  for (const fs::path& file : files) {
    fs::path to_open = file;
    // The recorder packs a file once it is full: the last one may still be as it is.
    if (file.extension() == ".zstd") {
      if (!decompressed_) decompressed_ = std::make_unique<TemporaryFolder>();
      to_open = decompressed_->path() / file.stem();
      decompress_file(file, to_open);
    }
    files_.push_back(open_file(to_open));
    names_.push_back(file);
    add_topics(*files_.back());
  }
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
  return compression_ == BagCompression::of_messages ? decompressed(stored) : stored;
}

std::vector<std::uint8_t> Bag::first_bytes(const BagMessage& message, int bytes) const {
  if (compression_ == BagCompression::of_messages) return this->bytes(message);
  return files_.at(message.file)->first_bytes(message, bytes);
}

std::vector<std::string> Bag::faults() const {
  std::vector<std::string> faults;
  for (std::size_t file = 0; file < files_.size(); ++file) {
    for (const std::string& fault : files_[file]->faults()) {
      faults.push_back(names_[file].string() + ": " + fault);
    }
  }
  return faults;
}

}  // namespace stillmap::dds
