#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "idl/bag/input_file.hpp"
#include "idl/bag/mcap_records.hpp"

namespace stillmap::dds::mcap {

/// A chunk, and where the file says what is in it.
struct StoredChunk {
  std::uint64_t offset = 0;
  /// By channel: where its MessageIndex begins.
  std::map<std::uint16_t, std::uint64_t> message_indexes;
};

/// A message that no index of the file leads to.
struct UnindexedMessage {
  std::uint64_t log_time_ns = 0;
  /// In the chunk's unpacked records; outside of chunks in the file.
  std::uint64_t offset = 0;
  /// From 1; 0: outside of chunks.
  std::uint32_t chunk = 0;
  std::uint16_t channel_id = 0;
};

/// Where everything lies in a file: some 100 bytes a chunk, and 24 a message without an index.
struct Contents {
  std::map<std::uint16_t, Schema> schemas;
  std::map<std::uint16_t, Channel> channels;
  std::map<std::uint16_t, std::uint64_t> channel_messages;
  std::vector<StoredChunk> chunks;
  std::vector<UnindexedMessage> unindexed;
  /// What cannot be read, in words.
  std::vector<std::string> faults;
};

/// By the file's summary; nothing where it has none, or none that tells where every message is.
/// Throws McapError for a summary that is damaged.
[[nodiscard]] std::optional<Contents> read_summary(const InputFile& file);

/// By going from record to record, without unpacking chunks that have indexes: for files whose
/// recorder was killed, or goes on, or wrote no summary. What comes before a damaged or missing
/// place is found, with a fault that names it.
[[nodiscard]] Contents scan_records(const InputFile& file);

/// By the summary, else from record to record. Throws DatasetError for what is no MCAP file.
[[nodiscard]] Contents read_contents(const InputFile& file);

/// The messages in a chunk's unpacked records, and the channels and schemas defined there. Throws
/// McapError.
[[nodiscard]] std::vector<UnindexedMessage> messages_in_chunk(std::span<const std::uint8_t> records,
                                                              std::uint32_t chunk,
                                                              Contents& defined);

/// Reads one record that begins there, with at most 64 MiB. Throws McapError where there is no such
/// record.
[[nodiscard]] std::vector<std::uint8_t> read_record(const InputFile& file, std::uint64_t offset,
                                                    Opcode opcode);

}  // namespace stillmap::dds::mcap
