#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "idl/bag/bag_metadata.hpp"
#include "idl/bag/zstd_decompression.hpp"

namespace SQLite {
class Database;
}

namespace stillmap::dds {

/// A message in a bag's file, without its bytes.
struct BagMessage {
  /// Which of the bag's files.
  std::size_t file = 0;
  std::int64_t row = 0;
  /// When it was received.
  std::int64_t received_ns = 0;
};

/// One .db3 file of a rosbag2, open for reading. All throw DatasetError. One thread uses it.
class BagFile {
 public:
  /// Refuses what is no SQLite database with rosbag2's tables.
  explicit BagFile(const std::filesystem::path& file);
  ~BagFile();
  BagFile(BagFile&&) noexcept;
  BagFile& operator=(BagFile&&) noexcept;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::vector<BagTopic> topics() const;
  /// Of a topic, in order of time; `file` is put into each.
  [[nodiscard]] std::vector<BagMessage> messages(const std::string& topic, std::size_t file) const;
  /// The bytes of a message, or the first so many of them.
  [[nodiscard]] std::vector<std::uint8_t> bytes(std::int64_t row) const;
  [[nodiscard]] std::vector<std::uint8_t> first_bytes(std::int64_t row, int bytes) const;

 private:
  [[nodiscard]] std::vector<std::uint8_t> blob(const char* query, std::int64_t row,
                                               int bytes) const;

  std::filesystem::path path_;
  std::unique_ptr<SQLite::Database> database_;
};

/// Whether a path is meant as a bag: a .db3, .mcap or .bag file, or a folder with metadata.yaml or
/// such a file.
[[nodiscard]] bool is_bag(const std::filesystem::path& path);

/// A rosbag2 in SQLite storage, split into several files or not, compressed with zstd or not. All
/// throw DatasetError. One thread uses it.
class Bag {
 public:
  /// A bag's folder (metadata.yaml may be missing), or one of its .db3 files alone.
  explicit Bag(const std::filesystem::path& path);

  /// With the messages of all files.
  [[nodiscard]] const std::vector<BagTopic>& topics() const { return topics_; }
  /// Of a topic, in order of time.
  [[nodiscard]] std::vector<BagMessage> messages(const std::string& topic) const;
  /// As it was serialized. CdrError for a message whose compression is damaged.
  [[nodiscard]] std::vector<std::uint8_t> bytes(const BagMessage& message) const;
  /// At least the first bytes of it.
  [[nodiscard]] std::vector<std::uint8_t> first_bytes(const BagMessage& message, int bytes) const;
  /// The name that a file has in the bag.
  [[nodiscard]] const std::filesystem::path& file_name(std::size_t file) const {
    return names_.at(file);
  }

 private:
  /// As its metadata says, whose compression is taken over.
  [[nodiscard]] std::vector<std::filesystem::path> files_of_folder(
      const std::filesystem::path& folder);
  void open(const std::vector<std::filesystem::path>& files);
  void add_topics(const BagFile& file);

  BagCompression compression_ = BagCompression::none;
  /// Of unpacked files; before what lies in it, so that it goes last.
  std::unique_ptr<TemporaryFolder> decompressed_;
  std::vector<BagFile> files_;
  std::vector<std::filesystem::path> names_;
  std::vector<BagTopic> topics_;
};

}  // namespace stillmap::dds
