#include "idl/bag/mcap_bag_file.hpp"

#include <algorithm>

#include "idl/bag/cdr_reader.hpp"

namespace stillmap::dds {
namespace {

constexpr std::uint64_t max_message_bytes = std::uint64_t{1} << 30U;

/// Both kinds of file have the record's head and the message's before its bytes.
constexpr std::size_t heads_bytes = mcap::record_head_bytes + mcap::message_head_bytes;

/// Of the message's own bytes; checks that there is the message that an index spoke of.
std::uint64_t message_length(std::span<const std::uint8_t> heads, const BagMessage& expected,
                             std::uint64_t left) {
  const mcap::RecordHead record = mcap::parse_record_head(heads);
  if (record.opcode != mcap::Opcode::message || record.length < mcap::message_head_bytes) {
    throw mcap::McapError("there is no message where its index says");
  }
  const mcap::MessageHead head = mcap::parse_message_head(heads.subspan(mcap::record_head_bytes));
  if (head.log_time_ns != static_cast<std::uint64_t>(expected.received_ns)) {
    throw mcap::McapError("there is another message where its index says");
  }
  if (record.length > left - mcap::record_head_bytes || record.length > max_message_bytes) {
    throw mcap::McapError("it says that it has " + std::to_string(record.length) + " bytes");
  }
  return record.length - mcap::message_head_bytes;
}

}  // namespace

McapBagFile::McapBagFile(const std::filesystem::path& file)
    : file_(file), contents_(mcap::read_contents(file_)) {}

std::vector<BagTopic> McapBagFile::topics() const {
  std::vector<BagTopic> topics;
  for (const auto& [id, channel] : contents_.channels) {
    const auto counted = contents_.channel_messages.find(id);
    const std::uint64_t messages =
        counted == contents_.channel_messages.end() ? 0 : counted->second;
    // Each publisher may have a channel of its own.
    const auto known = std::ranges::find(topics, channel.topic, &BagTopic::name);
    if (known != topics.end()) {
      known->messages += messages;
      continue;
    }
    const auto schema = contents_.schemas.find(channel.schema_id);
    const auto qos = channel.metadata.find("offered_qos_profiles");
    topics.push_back(
        {.name = channel.topic,
         .type = schema == contents_.schemas.end() ? std::string() : schema->second.name,
         .serialization_format = channel.message_encoding,
         .offered_qos_profiles = qos == channel.metadata.end() ? std::string() : qos->second,
         .messages = messages});
  }
  return topics;
}

std::vector<BagMessage> McapBagFile::messages(const std::string& topic, std::size_t file) const {
  std::vector<std::uint16_t> channels;
  for (const auto& [id, channel] : contents_.channels) {
    if (channel.topic == topic) channels.push_back(id);
  }
  std::vector<BagMessage> messages;
  for (const mcap::UnindexedMessage& message : contents_.unindexed) {
    if (!std::ranges::binary_search(channels, message.channel_id)) continue;
    messages.push_back({.row = static_cast<std::int64_t>(message.offset),
                        .chunk = message.chunk,
                        .received_ns = static_cast<std::int64_t>(message.log_time_ns)});
  }
  for (std::uint32_t chunk = 1; chunk <= contents_.chunks.size(); ++chunk) {
    for (const std::uint16_t channel : channels) {
      for (const mcap::MessageIndexEntry& entry : indexed_in(chunk, channel)) {
        messages.push_back({.row = static_cast<std::int64_t>(entry.offset),
                            .chunk = chunk,
                            .received_ns = static_cast<std::int64_t>(entry.log_time_ns)});
      }
    }
  }
  for (BagMessage& message : messages) message.file = file;
  std::ranges::stable_sort(messages, {}, &BagMessage::received_ns);
  return messages;
}

std::vector<mcap::MessageIndexEntry> McapBagFile::indexed_in(std::uint32_t chunk,
                                                             std::uint16_t channel) const {
  const auto& indexes = contents_.chunks[chunk - 1].message_indexes;
  const auto found = indexes.find(channel);
  if (found == indexes.end()) return {};
  try {
    auto index = mcap::parse_message_index(
        mcap::read_record(file_, found->second, mcap::Opcode::message_index));
    if (index.channel_id == channel) return std::move(index.entries);
  } catch (const mcap::McapError&) {
    // The chunk itself tells what its damaged index would.
  }
  return found_in(chunk, channel);
}

std::vector<mcap::MessageIndexEntry> McapBagFile::found_in(std::uint32_t chunk,
                                                           std::uint16_t channel) const {
  std::vector<mcap::MessageIndexEntry> entries;
  try {
    mcap::Contents defined;
    for (const auto& message : mcap::messages_in_chunk(chunk_reader(chunk).all(), chunk, defined)) {
      if (message.channel_id != channel) continue;
      entries.push_back({.log_time_ns = message.log_time_ns, .offset = message.offset});
    }
  } catch (const mcap::McapError&) {
    // One that stands for all: who reads it learns why there are no others.
    reader_.reset();
    entries = {{.log_time_ns = 0, .offset = 0}};
  }
  return entries;
}

mcap::ChunkReader& McapBagFile::chunk_reader(std::uint32_t chunk) const {
  if (!reader_ || reader_chunk_ != chunk) {
    reader_.reset();
    reader_.emplace(file_, contents_.chunks.at(chunk - 1).offset);
    reader_chunk_ = chunk;
  }
  return *reader_;
}

std::vector<std::uint8_t> McapBagFile::read_outside_of_chunks(const BagMessage& message,
                                                              std::uint64_t max_bytes) const {
  const auto offset = static_cast<std::uint64_t>(message.row);
  if (offset > file_.size() || file_.size() - offset < heads_bytes) {
    throw mcap::McapError("it lies behind the end of the file");
  }
  const std::uint64_t length =
      message_length(file_.read(offset, heads_bytes), message, file_.size() - offset);
  return file_.read(offset + heads_bytes, static_cast<std::size_t>(std::min(length, max_bytes)));
}

std::vector<std::uint8_t> McapBagFile::read_in_chunk(const BagMessage& message,
                                                     std::uint64_t max_bytes, bool checked) const {
  mcap::ChunkReader& chunk = chunk_reader(message.chunk);
  const auto offset = static_cast<std::uint64_t>(message.row);
  if (checked) static_cast<void>(chunk.all());
  if (offset > chunk.size() || chunk.size() - offset < heads_bytes) {
    throw mcap::McapError("it lies behind the chunk's end");
  }
  const auto heads = chunk.first(offset + heads_bytes).subspan(static_cast<std::size_t>(offset));
  const std::uint64_t length =
      std::min(message_length(heads, message, chunk.size() - offset), max_bytes);
  const auto bytes =
      chunk.first(offset + heads_bytes + length).last(static_cast<std::size_t>(length));
  return {bytes.begin(), bytes.end()};
}

std::vector<std::uint8_t> McapBagFile::read(const BagMessage& message, std::uint64_t max_bytes,
                                            bool checked) const {
  try {
    return message.chunk == 0 ? read_outside_of_chunks(message, max_bytes)
                              : read_in_chunk(message, max_bytes, checked);
  } catch (const mcap::McapError& fault) {
    if (message.chunk == 0) throw CdrError(fault.what());
    reader_.reset();
    throw CdrError("the chunk at byte " +
                   std::to_string(contents_.chunks.at(message.chunk - 1).offset) +
                   " is damaged: " + fault.what());
  }
}

std::vector<std::uint8_t> McapBagFile::bytes(const BagMessage& message) const {
  return read(message, max_message_bytes, true);
}

std::vector<std::uint8_t> McapBagFile::first_bytes(const BagMessage& message, int bytes) const {
  return read(message, static_cast<std::uint64_t>(bytes), false);
}

}  // namespace stillmap::dds
