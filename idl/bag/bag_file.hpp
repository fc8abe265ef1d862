#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
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
  /// SQLite: its row. MCAP: the byte at which its record begins, in its chunk or in the file.
  std::int64_t row = 0;
  /// MCAP: the chunk that holds it, from 1; 0 outside of chunks.
  std::uint32_t chunk = 0;
  /// When it was received.
  std::int64_t received_ns = 0;
};

/// One file of a rosbag2, open for reading. All throw DatasetError. One thread uses it.
class BagFile {
 public:
  BagFile() = default;
  virtual ~BagFile() = default;
  BagFile(const BagFile&) = delete;
  BagFile& operator=(const BagFile&) = delete;

  [[nodiscard]] virtual std::vector<BagTopic> topics() const = 0;
  /// Of a topic, in order of time; `file` is put into each.
  [[nodiscard]] virtual std::vector<BagMessage> messages(const std::string& topic,
                                                         std::size_t file) const = 0;
  /// The bytes of a message. CdrError where only this message, or what is packed with it, is
  /// damaged.
  [[nodiscard]] virtual std::vector<std::uint8_t> bytes(const BagMessage& message) const = 0;
  /// The first so many of them, or all when there are fewer.
  [[nodiscard]] virtual std::vector<std::uint8_t> first_bytes(const BagMessage& message,
                                                              int bytes) const = 0;
  /// What of the file cannot be read, in words; empty for a sound file.
  [[nodiscard]] virtual std::vector<std::string> faults() const { return {}; }
};

/// A .db3 file. Where the database is damaged, its messages are those that can be found by their
/// numbers, from the first one on and from the last one back.
class SqliteBagFile final : public BagFile {
 public:
  /// Refuses what is no SQLite database with rosbag2's tables, or whose topics cannot be read.
  explicit SqliteBagFile(const std::filesystem::path& file);
  ~SqliteBagFile() override;

  [[nodiscard]] std::vector<BagTopic> topics() const override;
  [[nodiscard]] std::vector<BagMessage> messages(const std::string& topic,
                                                 std::size_t file) const override;
  [[nodiscard]] std::vector<std::uint8_t> bytes(const BagMessage& message) const override;
  [[nodiscard]] std::vector<std::uint8_t> first_bytes(const BagMessage& message,
                                                      int bytes) const override;
  [[nodiscard]] std::vector<std::string> faults() const override { return faults_; }

 private:
  struct Row {
    BagMessage message;
    std::int64_t topic = 0;
  };

  void count_messages();
  /// In one direction of their numbers, up to the first that cannot be read or is `end`.
  [[nodiscard]] std::vector<Row> rows_until_damage(bool backwards, std::int64_t end) const;
  void find_readable_rows();
  /// messages() of a damaged file.
  [[nodiscard]] std::vector<BagMessage> readable_messages(const std::string& topic,
                                                          std::size_t file) const;
  [[nodiscard]] std::vector<std::uint8_t> blob(const char* query, std::int64_t row,
                                               int bytes) const;

  std::filesystem::path path_;
  std::unique_ptr<SQLite::Database> database_;
  /// By the number of the topic.
  std::map<std::int64_t, std::uint64_t> messages_of_topic_;
  /// What can be read of a damaged file, by number; nothing for a sound one.
  std::optional<std::vector<Row>> readable_;
  std::vector<std::string> faults_;
};

}  // namespace stillmap::dds
