#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "idl/bag/bag_metadata.hpp"

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

}  // namespace stillmap::dds
