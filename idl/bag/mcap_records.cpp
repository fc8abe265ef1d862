#include "idl/bag/mcap_records.hpp"

#include <cassert>
#include <utility>

namespace stillmap::dds::mcap {
namespace {

std::uint8_t number_of(Opcode opcode) { return static_cast<std::uint8_t>(opcode); }

template <std::unsigned_integral T>
void put(std::string& to, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    to.push_back(static_cast<char>(static_cast<std::uint8_t>(value >> (8 * i))));
  }
}

void put_text(std::string& to, std::string_view text) {
  put(to, static_cast<std::uint32_t>(text.size()));
  to.append(text);
}

/// Behind its length of 4 bytes.
template <typename Write>
void put_block(std::string& to, Write write) {
  std::string block;
  write(block);
  put_text(to, block);
}

template <typename Write>
void put_record(std::string& to, Opcode opcode, Write write) {
  std::string content;
  write(content);
  put(to, number_of(opcode));
  put(to, std::uint64_t{content.size()});
  to.append(content);
}

void put_head(std::string& to, Opcode opcode, std::size_t content_bytes) {
  put(to, number_of(opcode));
  put(to, std::uint64_t{content_bytes});
}

std::map<std::uint16_t, std::uint64_t> read_by_channel(FieldReader fields) {
  std::map<std::uint16_t, std::uint64_t> by_channel;
  while (!fields.empty()) {
    const auto channel = fields.number<std::uint16_t>();
    by_channel[channel] = fields.number<std::uint64_t>();
  }
  return by_channel;
}

void put_by_channel(std::string& to, const std::map<std::uint16_t, std::uint64_t>& by_channel) {
  put_block(to, [&](std::string& block) {
    for (const auto& [channel, value] : by_channel) {
      put(block, channel);
      put(block, value);
    }
  });
}

}  // namespace

std::string FieldReader::text() {
  const auto bytes = take(number<std::uint32_t>());
  return {bytes.begin(), bytes.end()};
}

std::span<const std::uint8_t> FieldReader::take(std::size_t bytes) {
  if (bytes > left_.size()) {
    throw McapError("a record ends before its fields do");
  }
  const auto taken = left_.first(bytes);
  left_ = left_.subspan(bytes);
  return taken;
}

RecordHead parse_record_head(std::span<const std::uint8_t> head) {
  FieldReader fields(head);
  RecordHead record;
  record.opcode = static_cast<Opcode>(fields.number<std::uint8_t>());
  record.length = fields.number<std::uint64_t>();
  if (number_of(record.opcode) == 0) throw McapError("a record has the opcode 0");
  return record;
}

Schema parse_schema(std::span<const std::uint8_t> content) {
  FieldReader fields(content);
  Schema schema;
  schema.id = fields.number<std::uint16_t>();
  schema.name = fields.text();
  schema.encoding = fields.text();
  schema.text = fields.text();
  return schema;
}

Channel parse_channel(std::span<const std::uint8_t> content) {
  FieldReader fields(content);
  Channel channel;
  channel.id = fields.number<std::uint16_t>();
  channel.schema_id = fields.number<std::uint16_t>();
  channel.topic = fields.text();
  channel.message_encoding = fields.text();
  FieldReader metadata = fields.block();
  while (!metadata.empty()) {
    std::string key = metadata.text();
    channel.metadata[std::move(key)] = metadata.text();
  }
  return channel;
}

MessageHead parse_message_head(std::span<const std::uint8_t> content) {
  FieldReader fields(content);
  MessageHead head;
  head.channel_id = fields.number<std::uint16_t>();
  head.sequence = fields.number<std::uint32_t>();
  head.log_time_ns = fields.number<std::uint64_t>();
  head.publish_time_ns = fields.number<std::uint64_t>();
  return head;
}

ChunkHead parse_chunk_head(std::span<const std::uint8_t> content, std::size_t& head_bytes) {
  FieldReader fields(content);
  ChunkHead head;
  head.start_ns = fields.number<std::uint64_t>();
  head.end_ns = fields.number<std::uint64_t>();
  head.uncompressed_bytes = fields.number<std::uint64_t>();
  head.crc = fields.number<std::uint32_t>();
  head.compression = fields.text();
  head.compressed_bytes = fields.number<std::uint64_t>();
  head_bytes = content.size() - fields.rest().size();
  return head;
}

MessageIndex parse_message_index(std::span<const std::uint8_t> content) {
  FieldReader fields(content);
  MessageIndex index;
  index.channel_id = fields.number<std::uint16_t>();
  FieldReader entries = fields.block();
  while (!entries.empty()) {
    const auto log_time_ns = entries.number<std::uint64_t>();
    index.entries.push_back({log_time_ns, entries.number<std::uint64_t>()});
  }
  return index;
}

ChunkIndex parse_chunk_index(std::span<const std::uint8_t> content) {
  FieldReader fields(content);
  ChunkIndex index;
  index.start_ns = fields.number<std::uint64_t>();
  index.end_ns = fields.number<std::uint64_t>();
  index.offset = fields.number<std::uint64_t>();
  index.length = fields.number<std::uint64_t>();
  index.message_indexes = read_by_channel(fields.block());
  index.message_indexes_bytes = fields.number<std::uint64_t>();
  index.compression = fields.text();
  index.compressed_bytes = fields.number<std::uint64_t>();
  index.uncompressed_bytes = fields.number<std::uint64_t>();
  return index;
}

Statistics parse_statistics(std::span<const std::uint8_t> content) {
  FieldReader fields(content);
  Statistics statistics;
  statistics.messages = fields.number<std::uint64_t>();
  statistics.schemas = fields.number<std::uint16_t>();
  statistics.channels = fields.number<std::uint32_t>();
  static_cast<void>(fields.number<std::uint32_t>());  // attachments
  static_cast<void>(fields.number<std::uint32_t>());  // metadata records
  statistics.chunks = fields.number<std::uint32_t>();
  statistics.start_ns = fields.number<std::uint64_t>();
  statistics.end_ns = fields.number<std::uint64_t>();
  statistics.channel_messages = read_by_channel(fields.block());
  return statistics;
}

Footer parse_footer(std::span<const std::uint8_t> content) {
  FieldReader fields(content);
  Footer footer;
  footer.summary_start = fields.number<std::uint64_t>();
  footer.summary_offset_start = fields.number<std::uint64_t>();
  footer.summary_crc = fields.number<std::uint32_t>();
  return footer;
}

void append_header(std::string& to, std::string_view profile, std::string_view library) {
  put_record(to, Opcode::header, [&](std::string& content) {
    put_text(content, profile);
    put_text(content, library);
  });
}

void append_schema(std::string& to, const Schema& schema) {
  put_record(to, Opcode::schema, [&](std::string& content) {
    put(content, schema.id);
    put_text(content, schema.name);
    put_text(content, schema.encoding);
    put_text(content, schema.text);
  });
}

void append_channel(std::string& to, const Channel& channel) {
  put_record(to, Opcode::channel, [&](std::string& content) {
    put(content, channel.id);
    put(content, channel.schema_id);
    put_text(content, channel.topic);
    put_text(content, channel.message_encoding);
    put_block(content, [&](std::string& metadata) {
      for (const auto& [key, value] : channel.metadata) {
        put_text(metadata, key);
        put_text(metadata, value);
      }
    });
  });
}

void append_message(std::string& to, const MessageHead& head, std::span<const std::uint8_t> bytes) {
  put_head(to, Opcode::message, message_head_bytes + bytes.size());
  put(to, head.channel_id);
  put(to, head.sequence);
  put(to, head.log_time_ns);
  put(to, head.publish_time_ns);
  to.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

void append_chunk(std::string& to, const ChunkHead& head, std::string_view records) {
  assert(head.compressed_bytes == records.size());
  std::string content;
  put(content, head.start_ns);
  put(content, head.end_ns);
  put(content, head.uncompressed_bytes);
  put(content, head.crc);
  put_text(content, head.compression);
  put(content, head.compressed_bytes);
  put_head(to, Opcode::chunk, content.size() + records.size());
  to.append(content).append(records);
}

void append_message_index(std::string& to, const MessageIndex& index) {
  put_record(to, Opcode::message_index, [&](std::string& content) {
    put(content, index.channel_id);
    put_block(content, [&](std::string& entries) {
      for (const MessageIndexEntry& entry : index.entries) {
        put(entries, entry.log_time_ns);
        put(entries, entry.offset);
      }
    });
  });
}

void append_chunk_index(std::string& to, const ChunkIndex& index) {
  put_record(to, Opcode::chunk_index, [&](std::string& content) {
    put(content, index.start_ns);
    put(content, index.end_ns);
    put(content, index.offset);
    put(content, index.length);
    put_by_channel(content, index.message_indexes);
    put(content, index.message_indexes_bytes);
    put_text(content, index.compression);
    put(content, index.compressed_bytes);
    put(content, index.uncompressed_bytes);
  });
}

void append_statistics(std::string& to, const Statistics& statistics) {
  put_record(to, Opcode::statistics, [&](std::string& content) {
    put(content, statistics.messages);
    put(content, statistics.schemas);
    put(content, statistics.channels);
    put(content, std::uint32_t{0});  // attachments
    put(content, std::uint32_t{0});  // metadata records
    put(content, statistics.chunks);
    put(content, statistics.start_ns);
    put(content, statistics.end_ns);
    put_by_channel(content, statistics.channel_messages);
  });
}

void append_summary_offset(std::string& to, Opcode group, std::uint64_t start,
                           std::uint64_t length) {
  put_record(to, Opcode::summary_offset, [&](std::string& content) {
    put(content, number_of(group));
    put(content, start);
    put(content, length);
  });
}

void append_data_end(std::string& to, std::uint32_t data_crc) {
  put_record(to, Opcode::data_end, [&](std::string& content) { put(content, data_crc); });
}

void append_footer_start(std::string& to, const Footer& footer) {
  put_head(to, Opcode::footer, footer_bytes);
  put(to, footer.summary_start);
  put(to, footer.summary_offset_start);
}

void append_number(std::string& to, std::uint32_t value) { put(to, value); }

}  // namespace stillmap::dds::mcap
