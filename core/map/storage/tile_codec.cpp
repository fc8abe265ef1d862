#include "core/map/storage/tile_codec.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "core/map/storage/tile_frame.hpp"
#include "core/map/tile.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

/// Writes or reads the fields of one record in turn: one list of fields serves both ways.
class FieldWriter {
 public:
  explicit FieldWriter(std::uint8_t* to) : to_(to) {}
  template <typename Field>
  void operator()(const Field& field) {
    std::memcpy(to_, &field, sizeof(field));
    to_ += sizeof(field);
  }

 private:
  std::uint8_t* to_;
};

class FieldReader {
 public:
  explicit FieldReader(const std::uint8_t* from) : from_(from) {}
  template <typename Field>
  void operator()(Field& field) {
    std::memcpy(&field, from_, sizeof(field));
    from_ += sizeof(field);
  }

 private:
  const std::uint8_t* from_;
};

/// Appends the records by byte planes: the first byte of all, the second byte of all, and so on,
/// which compresses better than record after record. `visit(visitor, record)` lists the fields,
/// `record_bytes` of them.
template <std::size_t record_bytes, typename Record, typename Visit>
void append_planes(std::vector<std::uint8_t>& bytes, const std::vector<Record>& records,
                   Visit visit) {
  const std::size_t count = records.size();
  std::vector<std::uint8_t> planes(count * record_bytes);
  std::array<std::uint8_t, record_bytes> record{};
  for (std::size_t i = 0; i < count; ++i) {
    visit(FieldWriter(record.data()), records[i]);
    for (std::size_t k = 0; k < record_bytes; ++k) planes[k * count + i] = record[k];
  }
  bytes.insert(bytes.end(), planes.begin(), planes.end());
}

/// Fills the records from planes that begin at `planes`; there are enough bytes for all.
template <std::size_t record_bytes, typename Record, typename Visit>
void read_planes(const std::uint8_t* planes, std::vector<Record>& records, Visit visit) {
  const std::size_t count = records.size();
  std::array<std::uint8_t, record_bytes> record{};
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < record_bytes; ++k) record[k] = planes[k * count + i];
    visit(FieldReader(record.data()), records[i]);
  }
}

inline constexpr std::size_t stored_voxel_bytes =
    3 * 2 + 4 + 3 * 4 + ClassEvidence::candidates * (1 + 4) + 16;

/// Every field of a voxel, in the order in which it is stored.
template <typename Visitor, typename AnyVoxel>
void visit_voxel(Visitor&& visit, AnyVoxel& voxel) {
  visit(voxel.index.x);
  visit(voxel.index.y);
  visit(voxel.index.z);
  visit(voxel.point_count);
  for (int axis = 0; axis < 3; ++axis) visit(voxel.mean_map[axis]);
  for (auto& vote : voxel.evidence.votes) {
    visit(vote.label);
    visit(vote.weight);
  }
  visit(voxel.first_seen_ns);
  visit(voxel.last_seen_ns);
}

static_assert(std::endian::native == std::endian::little,
              "fields are copied as they lie in memory");

constexpr std::uint8_t tile_format_version = 1;
constexpr std::size_t tile_header_bytes = 4 + 4 + 8 + 8 + 4;

template <typename Visitor, typename Info>
void visit_header(Visitor visit, Info& info) {
  visit(info.id.x);
  visit(info.id.y);
  visit(info.revision);
  visit(info.content_hash);
  visit(info.voxel_count);
}

constexpr auto visit_fields = [](auto visit, auto& voxel) { visit_voxel(visit, voxel); };

bool is_possible(const Voxel& voxel) {
  return voxel.index.x < VoxelGrid::max_columns && voxel.index.y < VoxelGrid::max_columns &&
         voxel.point_count > 0 && voxel.mean_map.allFinite() &&
         std::ranges::all_of(voxel.evidence.votes, [](const ClassEvidence::Vote& vote) {
           return static_cast<std::size_t>(vote.label) < semantic_class_count &&
                  vote.weight >= 0.0F && vote.weight <= ClassEvidence::max_total * 2.0F;
         });
}

Tile from_content(const std::vector<std::uint8_t>& content) {
  Tile tile;
  visit_header(FieldReader(content.data()), tile.info);
  const std::size_t count = tile.info.voxel_count;
  if (content.size() != tile_header_bytes + count * stored_voxel_bytes) {
    throw TileCodecError("has " + std::to_string(content.size()) + " bytes for " +
                         std::to_string(count) + " voxels");
  }
  tile.voxels.resize(count);
  read_planes<stored_voxel_bytes>(content.data() + tile_header_bytes, tile.voxels, visit_fields);
  for (const Voxel& voxel : tile.voxels) tile.info.bounds_map.extend(voxel.mean_map);
  return tile;
}

constexpr std::uint8_t evidence_format_version = 1;
constexpr std::size_t evidence_header_bytes = 4 + 4 + 3 * 4;
constexpr std::size_t history_bytes = 2 + 2 + 1;
constexpr std::size_t hidden_bytes = stored_voxel_bytes + history_bytes + 1;
constexpr std::size_t excluded_bytes = 3 * 2 + 1 + 1 + 8;
/// Stands for no reason.
constexpr std::uint8_t no_reason = 255;

enum Flag : std::uint8_t { was_shown_flag = 1, is_restored_flag = 2 };

using Counts = std::array<std::uint32_t, 3>;

/// As they are stored: plain numbers.
struct StoredHistory {
  std::uint16_t hits = 0;
  std::uint16_t misses = 0;
  std::uint8_t flags = 0;
};
struct StoredHidden {
  Voxel voxel;
  StoredHistory history;
  std::uint8_t reason = no_reason;
};
struct StoredExcluded {
  VoxelIndex index;
  std::uint8_t label = 0;
  std::uint8_t was_moving = 0;
  std::int64_t last_seen_ns = 0;
};

constexpr auto visit_history = [](auto&& visit, auto& history) {
  visit(history.hits);
  visit(history.misses);
  visit(history.flags);
};
constexpr auto visit_hidden = [](auto&& visit, auto& hidden) {
  visit_voxel(visit, hidden.voxel);
  visit_history(visit, hidden.history);
  visit(hidden.reason);
};
constexpr auto visit_excluded = [](auto&& visit, auto& excluded) {
  visit(excluded.index.x);
  visit(excluded.index.y);
  visit(excluded.index.z);
  visit(excluded.label);
  visit(excluded.was_moving);
  visit(excluded.last_seen_ns);
};

StoredHistory to_stored(const VoxelHistory& history) {
  const int flags =
      (history.was_shown ? was_shown_flag : 0) | (history.is_restored ? is_restored_flag : 0);
  return {history.hits, history.misses, static_cast<std::uint8_t>(flags)};
}

StoredHidden to_stored(const HiddenVoxel& hidden) {
  return {hidden.voxel, to_stored(hidden.history),
          hidden.reason ? static_cast<std::uint8_t>(*hidden.reason) : no_reason};
}

StoredExcluded to_stored(const ExcludedVoxel& excluded) {
  return {excluded.index, static_cast<std::uint8_t>(excluded.label),
          static_cast<std::uint8_t>(excluded.was_moving ? 1 : 0), excluded.last_seen_ns};
}

VoxelHistory from_stored(const StoredHistory& stored) {
  if (stored.flags > (was_shown_flag | is_restored_flag)) throw TileCodecError("has unknown flags");
  return {stored.hits, stored.misses, (stored.flags & was_shown_flag) != 0,
          (stored.flags & is_restored_flag) != 0};
}

HiddenVoxel from_stored(const StoredHidden& stored) {
  if (!is_possible(stored.voxel)) throw TileCodecError("has an impossible hidden voxel");
  HiddenVoxel hidden{stored.voxel, from_stored(stored.history), std::nullopt};
  if (stored.reason == no_reason) return hidden;
  if (stored.reason >= removal_reason_count) throw TileCodecError("has an unknown reason");
  hidden.reason = static_cast<RemovalReason>(stored.reason);
  return hidden;
}

ExcludedVoxel from_stored(const StoredExcluded& stored) {
  if (stored.index.x >= VoxelGrid::max_columns || stored.index.y >= VoxelGrid::max_columns ||
      stored.label >= semantic_class_count || stored.was_moving > 1) {
    throw TileCodecError("has an impossible excluded place");
  }
  return {stored.index, static_cast<SemanticClass>(stored.label), stored.was_moving == 1,
          stored.last_seen_ns};
}

template <typename Stored, typename Value>
std::vector<Stored> all_to_stored(const std::vector<Value>& values) {
  std::vector<Stored> stored(values.size());
  std::ranges::transform(values, stored.begin(), [](const Value& v) { return to_stored(v); });
  return stored;
}

/// Reads one list and moves on behind it.
template <std::size_t record_bytes, typename Stored, typename Value, typename Visit>
void read_list(const std::uint8_t*& from, std::uint32_t count, std::vector<Value>& values,
               Visit visit) {
  std::vector<Stored> stored(count);
  read_planes<record_bytes>(from, stored, visit);
  from += count * record_bytes;
  values.resize(count);
  std::ranges::transform(stored, values.begin(), [](const Stored& s) { return from_stored(s); });
}

template <typename Visitor, typename Id, typename AnyCounts>
void visit_header(Visitor visit, Id& id, AnyCounts& counts) {
  visit(id.x);
  visit(id.y);
  for (auto& count : counts) visit(count);
}

}  // namespace

std::vector<std::uint8_t> encode_tile(const Tile& tile) {
  std::vector<std::uint8_t> content(tile_header_bytes);
  visit_header(FieldWriter(content.data()), tile.info);
  append_planes<stored_voxel_bytes>(content, tile.voxels, visit_fields);
  return to_frame(tile_format_version, content);
}

Tile decode_tile(std::span<const std::uint8_t> bytes) {
  Tile tile = from_content(from_frame(tile_format_version, bytes, tile_header_bytes));
  if (!std::ranges::all_of(tile.voxels, is_possible)) {
    throw TileCodecError("has an impossible voxel");
  }
  const auto not_ascending = [](const Voxel& a, const Voxel& b) { return a.index >= b.index; };
  if (std::ranges::adjacent_find(tile.voxels, not_ascending) != tile.voxels.end()) {
    throw TileCodecError("has voxels out of order");
  }
  return tile;
}

std::vector<std::uint8_t> encode_evidence(const TileEvidence& evidence) {
  std::vector<std::uint8_t> content(evidence_header_bytes);
  const Counts counts{static_cast<std::uint32_t>(evidence.shown.size()),
                      static_cast<std::uint32_t>(evidence.hidden.size()),
                      static_cast<std::uint32_t>(evidence.excluded.size())};
  visit_header(FieldWriter(content.data()), evidence.id, counts);
  append_planes<history_bytes>(content, all_to_stored<StoredHistory>(evidence.shown),
                               visit_history);
  append_planes<hidden_bytes>(content, all_to_stored<StoredHidden>(evidence.hidden), visit_hidden);
  append_planes<excluded_bytes>(content, all_to_stored<StoredExcluded>(evidence.excluded),
                                visit_excluded);
  return to_frame(evidence_format_version, content);
}

TileEvidence decode_evidence(std::span<const std::uint8_t> bytes) {
  const std::vector<std::uint8_t> content =
      from_frame(evidence_format_version, bytes, evidence_header_bytes);
  TileEvidence evidence;
  Counts counts{};
  visit_header(FieldReader(content.data()), evidence.id, counts);
  const std::size_t needed = evidence_header_bytes + std::size_t{counts[0]} * history_bytes +
                             std::size_t{counts[1]} * hidden_bytes +
                             std::size_t{counts[2]} * excluded_bytes;
  if (content.size() != needed) {
    throw TileCodecError("has evidence of " + std::to_string(content.size()) +
                         " bytes instead of " + std::to_string(needed));
  }
  const std::uint8_t* from = content.data() + evidence_header_bytes;
  read_list<history_bytes, StoredHistory>(from, counts[0], evidence.shown, visit_history);
  read_list<hidden_bytes, StoredHidden>(from, counts[1], evidence.hidden, visit_hidden);
  read_list<excluded_bytes, StoredExcluded>(from, counts[2], evidence.excluded, visit_excluded);
  return evidence;
}

}  // namespace stillmap
