#include "idl/bag/mcap_contents.hpp"

#include <algorithm>
#include <numeric>

#include "core/dataset/dataset_error.hpp"
#include "idl/bag/mcap_chunk.hpp"

namespace stillmap::dds::mcap {
namespace {

/// Of everything but messages and chunks, which are read in pieces.
constexpr std::uint64_t max_record_bytes = std::uint64_t{64} << 20U;
/// Of a MessageIndex: its head, channel and the length of its entries; and of an entry.
constexpr std::uint64_t index_head_bytes = record_head_bytes + 6;
constexpr std::uint64_t index_entry_bytes = 16;

std::string at(std::uint64_t offset) { return "byte " + std::to_string(offset); }

/// A record's head, checked to lie within [offset, end).
RecordHead record_at(const InputFile& file, std::uint64_t offset, std::uint64_t end) {
  if (end - offset < record_head_bytes) throw McapError("the file is cut off in a record");
  const RecordHead head = parse_record_head(file.read(offset, record_head_bytes));
  if (head.length > end - offset - record_head_bytes) {
    throw McapError("the file is cut off in a record, or the record's length is damaged");
  }
  return head;
}

void add_definition(Contents& contents, Opcode opcode, std::span<const std::uint8_t> content) {
  if (opcode == Opcode::schema) {
    Schema schema = parse_schema(content);
    contents.schemas[schema.id] = std::move(schema);
  } else if (opcode == Opcode::channel) {
    Channel channel = parse_channel(content);
    contents.channels[channel.id] = std::move(channel);
  }
}

bool is_magic(std::span<const std::uint8_t> bytes) {
  return std::ranges::equal(bytes, magic,
                            [](std::uint8_t a, char b) { return static_cast<char>(a) == b; });
}

std::optional<Footer> read_footer(const InputFile& file) {
  constexpr std::size_t end_bytes = record_head_bytes + footer_bytes + magic.size();
  if (file.size() < magic.size() + end_bytes) return std::nullopt;
  const auto end = file.read(file.size() - end_bytes, end_bytes);
  const std::span<const std::uint8_t> bytes(end);
  FieldReader head(bytes);
  if (head.number<std::uint8_t>() != static_cast<std::uint8_t>(Opcode::footer) ||
      head.number<std::uint64_t>() != footer_bytes || !is_magic(bytes.last(magic.size()))) {
    return std::nullopt;
  }
  return parse_footer(bytes.subspan(record_head_bytes, footer_bytes));
}

void check_crc(const InputFile& file, const Footer& footer) {
  if (footer.summary_crc == 0) return;
  constexpr std::uint64_t step_bytes = std::uint64_t{256} << 10U;
  const std::uint64_t end = file.size() - magic.size() - sizeof footer.summary_crc;
  std::uint32_t crc = 0;
  for (std::uint64_t offset = footer.summary_start; offset < end; offset += step_bytes) {
    const auto bytes = static_cast<std::size_t>(std::min(step_bytes, end - offset));
    crc = crc32(file.read(offset, bytes), crc);
  }
  if (crc != footer.summary_crc) throw McapError("its bytes are not those that were written (CRC)");
}

/// How many messages the indexes of a summary lead to.
std::uint64_t indexed_messages(const ChunkIndex& index) {
  const std::uint64_t heads = index_head_bytes * index.message_indexes.size();
  if (index.message_indexes_bytes < heads) throw McapError("an index is shorter than its parts");
  return (index.message_indexes_bytes - heads) / index_entry_bytes;
}

/// What a summary says besides where the chunks are.
struct Counted {
  std::uint64_t indexed = 0;
  std::optional<Statistics> statistics;
};

void add_summary_record(Contents& contents, Counted& counted, Opcode opcode,
                        std::span<const std::uint8_t> content) {
  add_definition(contents, opcode, content);
  if (opcode == Opcode::chunk_index) {
    ChunkIndex index = parse_chunk_index(content);
    counted.indexed += indexed_messages(index);
    contents.chunks.push_back(
        {.offset = index.offset, .message_indexes = std::move(index.message_indexes)});
  } else if (opcode == Opcode::statistics) {
    counted.statistics = parse_statistics(content);
  }
}

/// Whether all messages are counted by channel, too: an empty list says that they are not.
bool counts_channels(const Statistics& statistics) {
  const auto& counts = statistics.channel_messages;
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0},
                         [](std::uint64_t sum, const auto& count) { return sum + count.second; }) ==
         statistics.messages;
}

bool has_all_schemas(const Contents& contents) {
  return std::ranges::all_of(contents.channels, [&](const auto& channel) {
    return channel.second.schema_id == 0 || contents.schemas.contains(channel.second.schema_id);
  });
}

/// Goes through a file from record to record.
class Scan {
 public:
  explicit Scan(const InputFile& file) : file_(file) {}

  [[nodiscard]] Contents run() {
    std::uint64_t offset = magic.size();
    try {
      while (offset < file_.size() && !ended_) {
        const RecordHead head = record_at(file_, offset, file_.size());
        read(head, offset);
        offset += record_head_bytes + head.length;
      }
      finish_chunk(ended_);
      if (!ended_) fault("it was not finished (its recorder was killed, or goes on)");
    } catch (const McapError& fault_here) {
      // Records have no mark by which the next could be found.
      fault(std::string(fault_here.what()) + " at " + at(offset) + " of " +
            std::to_string(file_.size()) + "; what comes before that is read");
      finish_chunk(false);
    }
    return std::move(contents_);
  }

 private:
  void fault(const std::string& words) { contents_.faults.push_back(words); }

  void read(const RecordHead& head, std::uint64_t offset) {
    if (head.opcode != Opcode::message_index) finish_chunk(true);
    switch (head.opcode) {
      case Opcode::schema:
      case Opcode::channel:
        add_definition(contents_, head.opcode, read_record(file_, offset, head.opcode));
        break;
      case Opcode::message:
        add_message(head, offset);
        break;
      case Opcode::chunk:
        contents_.chunks.push_back({.offset = offset, .message_indexes = {}});
        open_chunk_ = true;
        break;
      case Opcode::message_index:
        add_index(head, offset);
        break;
      case Opcode::data_end:
      case Opcode::footer:
        ended_ = true;
        break;
      default:
        break;
    }
  }

  void add_message(const RecordHead& head, std::uint64_t offset) {
    if (head.length < message_head_bytes) throw McapError("a message is shorter than its head");
    const MessageHead message =
        parse_message_head(file_.read(offset + record_head_bytes, message_head_bytes));
    contents_.unindexed.push_back({.log_time_ns = message.log_time_ns,
                                   .offset = offset,
                                   .chunk = 0,
                                   .channel_id = message.channel_id});
    ++contents_.channel_messages[message.channel_id];
  }

  void add_index(const RecordHead& head, std::uint64_t offset) {
    constexpr std::uint64_t fixed_bytes = index_head_bytes - record_head_bytes;
    if (!open_chunk_ || head.length < fixed_bytes) return;
    const auto channel = FieldReader(file_.read(offset + record_head_bytes, sizeof(std::uint16_t)))
                             .number<std::uint16_t>();
    const std::uint64_t entries = (head.length - fixed_bytes) / index_entry_bytes;
    if (entries == 0) return;
    contents_.chunks.back().message_indexes[channel] = offset;
    open_chunk_messages_[channel] = entries;
  }

  /// Unpacks the chunk where it has no indexes, or they do not go on to its end, or it defines the
  /// channels that they are of.
  void finish_chunk(bool whole_indexes) {
    if (!open_chunk_) return;
    open_chunk_ = false;
    StoredChunk& chunk = contents_.chunks.back();
    const bool indexed = whole_indexes && !chunk.message_indexes.empty();
    if (!indexed || defines_channels(chunk)) unpack(chunk, indexed);
    for (const auto& [channel, entries] : open_chunk_messages_) {
      if (chunk.message_indexes.contains(channel)) contents_.channel_messages[channel] += entries;
    }
    open_chunk_messages_.clear();
  }

  [[nodiscard]] bool defines_channels(const StoredChunk& chunk) const {
    return std::ranges::any_of(chunk.message_indexes, [&](const auto& index) {
      return !contents_.channels.contains(index.first);
    });
  }

  void unpack(StoredChunk& chunk, bool indexed) {
    try {
      ChunkReader reader(file_, chunk.offset);
      const auto number = static_cast<std::uint32_t>(contents_.chunks.size());
      const auto messages = messages_in_chunk(reader.all(), number, contents_);
      if (indexed) return;
      chunk.message_indexes.clear();
      for (const UnindexedMessage& message : messages) {
        contents_.unindexed.push_back(message);
        ++contents_.channel_messages[message.channel_id];
      }
    } catch (const McapError& damage) {
      fault("the chunk at " + at(chunk.offset) + " cannot be read: " + damage.what());
    }
  }

  const InputFile& file_;
  Contents contents_;
  bool ended_ = false;
  /// The last chunk, whose indexes may follow.
  bool open_chunk_ = false;
  std::map<std::uint16_t, std::uint64_t> open_chunk_messages_;
};

}  // namespace

std::vector<std::uint8_t> read_record(const InputFile& file, std::uint64_t offset, Opcode opcode) {
  if (offset > file.size()) throw McapError("a record lies behind the end of the file");
  const RecordHead head = record_at(file, offset, file.size());
  if (head.opcode != opcode) throw McapError("another record lies where one should be");
  if (head.length > max_record_bytes) {
    throw McapError("a record has " + std::to_string(head.length >> 20U) + " MiB; at most " +
                    std::to_string(max_record_bytes >> 20U) + " are read");
  }
  return file.read(offset + record_head_bytes, static_cast<std::size_t>(head.length));
}

std::vector<UnindexedMessage> messages_in_chunk(std::span<const std::uint8_t> records,
                                                std::uint32_t chunk, Contents& defined) {
  std::vector<UnindexedMessage> messages;
  FieldReader left(records);
  while (!left.empty()) {
    const std::uint64_t offset = records.size() - left.rest().size();
    const RecordHead head = parse_record_head(left.take(record_head_bytes));
    const auto content = left.take(static_cast<std::size_t>(head.length));
    add_definition(defined, head.opcode, content);
    if (head.opcode != Opcode::message) continue;
    const MessageHead message = parse_message_head(content);
    messages.push_back({.log_time_ns = message.log_time_ns,
                        .offset = offset,
                        .chunk = chunk,
                        .channel_id = message.channel_id});
  }
  return messages;
}

std::optional<Contents> read_summary(const InputFile& file) {
  const auto footer = read_footer(file);
  if (!footer || footer->summary_start == 0) return std::nullopt;
  const std::uint64_t end = file.size() - magic.size() - footer_bytes - record_head_bytes;
  if (footer->summary_start < magic.size() || footer->summary_start > end) {
    throw McapError("the footer says that it lies outside of the file");
  }
  check_crc(file, *footer);
  Contents contents;
  Counted counted;
  for (std::uint64_t offset = footer->summary_start; offset < end;) {
    const RecordHead head = record_at(file, offset, end);
    add_summary_record(contents, counted, head.opcode, read_record(file, offset, head.opcode));
    offset += record_head_bytes + head.length;
  }
  // Writers may leave indexes, statistics and definitions out.
  if (!counted.statistics || counted.statistics->messages != counted.indexed ||
      !counts_channels(*counted.statistics) ||
      counted.statistics->channels > contents.channels.size() || !has_all_schemas(contents)) {
    return std::nullopt;
  }
  contents.channel_messages = counted.statistics->channel_messages;
  return contents;
}

Contents scan_records(const InputFile& file) { return Scan(file).run(); }

Contents read_contents(const InputFile& file) {
  const auto begin =
      file.read(0, static_cast<std::size_t>(std::min<std::uint64_t>(file.size(), magic.size())));
  if (!is_magic(begin)) {
    throw DatasetError(file.path(), "is no MCAP file: it does not begin with MCAP's magic number");
  }
  std::string damage;
  try {
    if (auto contents = read_summary(file)) return *std::move(contents);
  } catch (const McapError& fault) {
    damage = std::string("its summary is damaged: ") + fault.what();
  }
  Contents contents = scan_records(file);
  if (!damage.empty()) contents.faults.insert(contents.faults.begin(), damage);
  return contents;
}

}  // namespace stillmap::dds::mcap
