#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace stillmap::dds::mcap {

// MCAP (https://mcap.dev/spec): a magic number, records (opcode, length, content; all numbers
// little-endian) and the magic number again. Messages lie in chunks, which may be compressed, each
// followed by an index for each of its channels; a summary at the end repeats what a reader needs
// to find everything, and a footer says where the summary begins.

inline constexpr std::string_view magic{"\x89MCAP0\r\n", 8};

/// Kinds of records, with their numbers in a file.
enum class Opcode : std::uint8_t {
  header = 1,
  footer = 2,
  schema = 3,
  channel = 4,
  message = 5,
  chunk = 6,
  message_index = 7,
  chunk_index = 8,
  statistics = 11,
  summary_offset = 14,
  data_end = 15,
};

/// Opcode and length.
inline constexpr std::size_t record_head_bytes = 9;
/// Channel, sequence, two times: what stands before a message's bytes.
inline constexpr std::size_t message_head_bytes = 22;
inline constexpr std::size_t footer_bytes = 20;

/// Bytes that are no MCAP record.
class McapError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reads the fields of one record. All throw McapError where the record is too short.
class FieldReader {
 public:
  explicit FieldReader(std::span<const std::uint8_t> content) : left_(content) {}

  template <std::unsigned_integral T>
  [[nodiscard]] T number() {
    T value = 0;
    for (std::size_t i = 0; const std::uint8_t byte : take(sizeof(T))) {
      value = static_cast<T>(value | static_cast<T>(T{byte} << (8 * i++)));
    }
    return value;
  }
  [[nodiscard]] std::string text();
  /// A list or map that stands behind its length of 4 bytes.
  [[nodiscard]] FieldReader block() { return FieldReader(take(number<std::uint32_t>())); }
  [[nodiscard]] std::span<const std::uint8_t> take(std::size_t bytes);
  [[nodiscard]] std::span<const std::uint8_t> rest() const { return left_; }
  [[nodiscard]] bool empty() const { return left_.empty(); }

 private:
  std::span<const std::uint8_t> left_;
};

/// The length is that of what follows.
struct RecordHead {
  Opcode opcode{};
  std::uint64_t length = 0;
};

struct Schema {
  std::uint16_t id = 0;
  /// "sensor_msgs/msg/PointCloud2".
  std::string name;
  /// "ros2msg"; empty where nothing is known of the type.
  std::string encoding;
  std::string text;
};

struct Channel {
  std::uint16_t id = 0;
  /// 0: none.
  std::uint16_t schema_id = 0;
  std::string topic;
  /// "cdr".
  std::string message_encoding;
  /// rosbag2 keeps offered_qos_profiles in it.
  std::map<std::string, std::string> metadata;
};

/// Without its bytes.
struct MessageHead {
  std::uint16_t channel_id = 0;
  std::uint32_t sequence = 0;
  std::uint64_t log_time_ns = 0;
  std::uint64_t publish_time_ns = 0;
};

/// What stands before a chunk's records.
struct ChunkHead {
  std::uint64_t start_ns = 0;
  std::uint64_t end_ns = 0;
  std::uint64_t uncompressed_bytes = 0;
  /// Of the unpacked records; 0: none was computed.
  std::uint32_t crc = 0;
  /// "", "zstd" or "lz4".
  std::string compression;
  std::uint64_t compressed_bytes = 0;
};

struct MessageIndexEntry {
  std::uint64_t log_time_ns = 0;
  /// In the unpacked records of the chunk.
  std::uint64_t offset = 0;
};

struct MessageIndex {
  std::uint16_t channel_id = 0;
  std::vector<MessageIndexEntry> entries;
};

/// Times are log times [ns]; offset and length are in the file.
struct ChunkIndex {
  std::uint64_t start_ns = 0;
  std::uint64_t end_ns = 0;
  /// Of the whole record, with its head.
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  /// By channel: where its MessageIndex begins.
  std::map<std::uint16_t, std::uint64_t> message_indexes;
  std::uint64_t message_indexes_bytes = 0;
  std::string compression;
  std::uint64_t compressed_bytes = 0;
  std::uint64_t uncompressed_bytes = 0;
};

/// Of the whole file. Times are log times [ns].
struct Statistics {
  std::uint64_t messages = 0;
  std::uint16_t schemas = 0;
  std::uint32_t channels = 0;
  std::uint32_t chunks = 0;
  std::uint64_t start_ns = 0;
  std::uint64_t end_ns = 0;
  std::map<std::uint16_t, std::uint64_t> channel_messages;
};

struct Footer {
  /// 0: there is no summary.
  std::uint64_t summary_start = 0;
  std::uint64_t summary_offset_start = 0;
  /// Of the summary and the footer up to here; 0: none was computed.
  std::uint32_t summary_crc = 0;
};

/// The parsers throw McapError. The span is a record's content, or its beginning for heads.
[[nodiscard]] RecordHead parse_record_head(std::span<const std::uint8_t> head);
[[nodiscard]] Schema parse_schema(std::span<const std::uint8_t> content);
[[nodiscard]] Channel parse_channel(std::span<const std::uint8_t> content);
[[nodiscard]] MessageHead parse_message_head(std::span<const std::uint8_t> content);
/// `head_bytes` becomes the number of bytes before the chunk's records.
[[nodiscard]] ChunkHead parse_chunk_head(std::span<const std::uint8_t> content,
                                         std::size_t& head_bytes);
[[nodiscard]] MessageIndex parse_message_index(std::span<const std::uint8_t> content);
[[nodiscard]] ChunkIndex parse_chunk_index(std::span<const std::uint8_t> content);
[[nodiscard]] Statistics parse_statistics(std::span<const std::uint8_t> content);
[[nodiscard]] Footer parse_footer(std::span<const std::uint8_t> content);

/// Appends the whole record, with its head.
void append_header(std::string& to, std::string_view profile, std::string_view library);
void append_schema(std::string& to, const Schema& schema);
void append_channel(std::string& to, const Channel& channel);
void append_message(std::string& to, const MessageHead& head, std::span<const std::uint8_t> bytes);
/// `records`: as they are stored, that is compressed.
void append_chunk(std::string& to, const ChunkHead& head, std::string_view records);
void append_message_index(std::string& to, const MessageIndex& index);
void append_chunk_index(std::string& to, const ChunkIndex& index);
void append_statistics(std::string& to, const Statistics& statistics);
void append_summary_offset(std::string& to, Opcode group, std::uint64_t start,
                           std::uint64_t length);
void append_data_end(std::string& to, std::uint32_t data_crc);
/// Without its last field, the CRC, which covers what comes before it.
void append_footer_start(std::string& to, const Footer& footer);
void append_number(std::string& to, std::uint32_t value);

}  // namespace stillmap::dds::mcap
