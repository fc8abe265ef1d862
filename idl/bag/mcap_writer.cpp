#include "idl/bag/mcap_writer.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <limits>

#include "core/dataset/dataset_error.hpp"

namespace stillmap::dds {
namespace {

/// Larger chunks compress little better, and cost a reader who wants one message more.
constexpr std::size_t chunk_bytes = std::size_t{1} << 20U;

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

McapWriter::McapWriter(const std::filesystem::path& file, const std::vector<BagTopic>& topics,
                       mcap::Compression compression)
    : file_(file),
      descriptor_(::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)),
      compression_(compression) {
  if (descriptor_ < 0) {
    throw DatasetError(file_, std::string("cannot be made: ") + std::strerror(errno));
  }
  add_channels(topics);
  begin_chunk();
  std::string begin(mcap::magic);
  mcap::append_header(begin, "ros2", "stillmap");
  write(begin);
}

McapWriter::~McapWriter() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void McapWriter::add_channels(const std::vector<BagTopic>& topics) {
  for (const BagTopic& topic : topics) {
    const auto known = std::ranges::find(schemas_, topic.type, &mcap::Schema::name);
    // 0 would be no schema.
    const auto schema = static_cast<std::uint16_t>(known - schemas_.begin() + 1);
    if (known == schemas_.end()) {
      schemas_.push_back({.id = schema,
                          .name = topic.type,
                          .encoding = topic.definition.empty() ? "" : "ros2msg",
                          .text = topic.definition});
    }
    channels_.push_back({.id = static_cast<std::uint16_t>(channels_.size()),
                         .schema_id = schema,
                         .topic = topic.name,
                         .message_encoding = topic.serialization_format,
                         .metadata = {{"offered_qos_profiles", topic.offered_qos_profiles}}});
  }
  sequences_.resize(channels_.size());
}

void McapWriter::begin_chunk() {
  chunk_.records.clear();
  chunk_.indexes.assign(channels_.size(), {});
  for (const mcap::Channel& channel : channels_) chunk_.indexes[channel.id].channel_id = channel.id;
  chunk_.start_ns = std::numeric_limits<std::uint64_t>::max();
  chunk_.end_ns = 0;
}

void McapWriter::define(const mcap::Channel& channel) {
  // A schema may be there already, for another channel; twice the same is no fault.
  mcap::append_schema(chunk_.records, schemas_[channel.schema_id - 1U]);
  mcap::append_channel(chunk_.records, channel);
}

void McapWriter::count(const mcap::MessageHead& message) {
  chunk_.indexes[message.channel_id].entries.push_back(
      {.log_time_ns = message.log_time_ns, .offset = chunk_.records.size()});
  chunk_.start_ns = std::min(chunk_.start_ns, message.log_time_ns);
  chunk_.end_ns = std::max(chunk_.end_ns, message.log_time_ns);
  statistics_.start_ns = statistics_.messages == 0
                             ? message.log_time_ns
                             : std::min(statistics_.start_ns, message.log_time_ns);
  statistics_.end_ns = std::max(statistics_.end_ns, message.log_time_ns);
  ++statistics_.messages;
  ++statistics_.channel_messages[message.channel_id];
}

void McapWriter::add(std::size_t topic, std::int64_t received_ns,
                     std::span<const std::uint8_t> message) {
  assert(topic < channels_.size());
  std::uint32_t& sequence = sequences_[topic];
  if (sequence == 0) define(channels_[topic]);
  const auto now_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(received_ns, 0));
  const mcap::MessageHead head{.channel_id = channels_[topic].id,
                               .sequence = ++sequence,
                               .log_time_ns = now_ns,
                               .publish_time_ns = now_ns};
  count(head);
  mcap::append_message(chunk_.records, head, message);
  if (chunk_.records.size() >= chunk_bytes) commit();
}

mcap::ChunkHead McapWriter::append_packed(std::string& to) const {
  const std::string packed = mcap::compressed(chunk_.records, compression_);
  const mcap::ChunkHead head{.start_ns = chunk_.start_ns,
                             .end_ns = chunk_.end_ns,
                             .uncompressed_bytes = chunk_.records.size(),
                             .crc = mcap::crc32(bytes_of(chunk_.records)),
                             .compression = std::string(mcap::compression_name(compression_)),
                             .compressed_bytes = packed.size()};
  mcap::append_chunk(to, head, packed);
  return head;
}

void McapWriter::commit() {
  if (chunk_.records.empty()) return;
  std::string records;
  const mcap::ChunkHead head = append_packed(records);
  mcap::ChunkIndex index{.start_ns = head.start_ns,
                         .end_ns = head.end_ns,
                         .offset = written_,
                         .length = records.size(),
                         .message_indexes = {},
                         .message_indexes_bytes = 0,
                         .compression = head.compression,
                         .compressed_bytes = head.compressed_bytes,
                         .uncompressed_bytes = head.uncompressed_bytes};
  for (const mcap::MessageIndex& of_channel : chunk_.indexes) {
    if (of_channel.entries.empty()) continue;
    index.message_indexes[of_channel.channel_id] = written_ + records.size();
    mcap::append_message_index(records, of_channel);
  }
  index.message_indexes_bytes = records.size() - index.length;
  write(records);
  chunks_.push_back(std::move(index));
  begin_chunk();
}

std::string McapWriter::summary(std::uint64_t begin) const {
  std::string records, offsets;
  const auto group = [&](mcap::Opcode opcode, const auto& append_all) {
    const std::size_t start = records.size();
    append_all();
    if (records.size() == start) return;
    mcap::append_summary_offset(offsets, opcode, begin + start, records.size() - start);
  };
  group(mcap::Opcode::schema, [&] {
    for (const mcap::Schema& schema : schemas_) mcap::append_schema(records, schema);
  });
  group(mcap::Opcode::channel, [&] {
    for (const mcap::Channel& channel : channels_) mcap::append_channel(records, channel);
  });
  group(mcap::Opcode::statistics, [&] { mcap::append_statistics(records, statistics_); });
  group(mcap::Opcode::chunk_index, [&] {
    for (const mcap::ChunkIndex& chunk : chunks_) mcap::append_chunk_index(records, chunk);
  });
  const std::uint64_t offsets_begin = begin + records.size();
  records += offsets;
  mcap::append_footer_start(records,
                            {.summary_start = begin, .summary_offset_start = offsets_begin});
  mcap::append_number(records, mcap::crc32(bytes_of(records)));
  return records.append(mcap::magic);
}

void McapWriter::finish() {
  commit();
  statistics_.schemas = static_cast<std::uint16_t>(schemas_.size());
  statistics_.channels = static_cast<std::uint32_t>(channels_.size());
  statistics_.chunks = static_cast<std::uint32_t>(chunks_.size());
  std::string end;
  mcap::append_data_end(end, data_crc_);
  end += summary(written_ + end.size());
  write(end);
  ::close(descriptor_);
  descriptor_ = -1;
}

void McapWriter::write(std::string_view bytes) {
  for (std::string_view left = bytes; !left.empty();) {
    const ssize_t put = ::write(descriptor_, left.data(), left.size());
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) {
      const std::string fault = std::strerror(errno);
      // A record that is cut off would end what can be read of a file that goes on after it.
      static_cast<void>(::ftruncate(descriptor_, static_cast<off_t>(written_)));
      static_cast<void>(::lseek(descriptor_, static_cast<off_t>(written_), SEEK_SET));
      throw DatasetWriteError(
          file_, "cannot be written: " + fault + "; what was committed before is kept");
    }
    left.remove_prefix(static_cast<std::size_t>(put));
  }
  written_ += bytes.size();
  data_crc_ = mcap::crc32(bytes_of(bytes), data_crc_);
}

}  // namespace stillmap::dds
