#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "core/process/temporary_folder.hpp"
#include "idl/bag/bag_file.hpp"
#include "idl/bag/bag_metadata.hpp"

namespace stillmap::dds {

/// Whether a path is meant as a bag: a .db3, .mcap or .bag file, or a folder with metadata.yaml or
/// such a file.
[[nodiscard]] bool is_bag(const std::filesystem::path& path);

/// A rosbag2 in SQLite or MCAP storage, split into several files or not, compressed or not. What of
/// its files is missing or cannot be opened is left out as long as there is another (see faults()).
/// All throw DatasetError. One thread uses it.
class Bag {
 public:
  /// A bag's folder (metadata.yaml may be missing), or one of its .db3 or .mcap files alone.
  explicit Bag(const std::filesystem::path& path);

  /// With the messages of all files.
  [[nodiscard]] const std::vector<BagTopic>& topics() const { return topics_; }
  /// Of a topic, in order of time.
  [[nodiscard]] std::vector<BagMessage> messages(const std::string& topic) const;
  /// As it was serialized, unpacked where it was packed, whatever the metadata says. CdrError for a
  /// message whose compression is damaged.
  [[nodiscard]] std::vector<std::uint8_t> bytes(const BagMessage& message) const;
  /// At least the first bytes of it.
  [[nodiscard]] std::vector<std::uint8_t> first_bytes(const BagMessage& message, int bytes) const;
  /// The name that a file has in the bag.
  [[nodiscard]] const std::filesystem::path& file_name(std::size_t file) const {
    return names_.at(file);
  }
  /// What of the files cannot be read, and which are left out, in words, with the file's name;
  /// empty for a sound bag.
  [[nodiscard]] std::vector<std::string> faults() const;

 private:
  /// As its metadata says, whose compression is taken over; those that lie there without being of
  /// it, or the other way round, are noted.
  [[nodiscard]] std::vector<std::filesystem::path> files_of_folder(
      const std::filesystem::path& folder);
  /// Notes what cannot be opened; throws its fault where nothing can.
  void open(const std::vector<std::filesystem::path>& files);
  void open_file(const std::filesystem::path& file);
  void add_topics(const BagFile& file);

  BagCompression compression_ = BagCompression::none;
  /// Of unpacked files; before what lies in it, so that it goes last.
  std::unique_ptr<TemporaryFolder> decompressed_;
  std::vector<std::unique_ptr<const BagFile>> files_;
  std::vector<std::filesystem::path> names_;
  std::vector<BagTopic> topics_;
  /// Files that are not read, and why.
  std::vector<std::string> left_out_;
};

}  // namespace stillmap::dds
