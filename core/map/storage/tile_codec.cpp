#include "core/map/storage/tile_codec.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/map/storage/byte_planes.hpp"
#include "core/map/storage/first_tile_format.hpp"
#include "core/map/storage/packed_codec.hpp"
#include "core/map/storage/tile_frame.hpp"
#include "core/map/tile.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

struct StoredGrid {
  double voxel_size_m = 0.0;
  std::uint16_t columns = 0;
};
constexpr std::size_t grid_bytes = 8 + 2;

StoredGrid to_stored(const VoxelGrid& grid) {
  return {grid.voxel_size_m(), static_cast<std::uint16_t>(grid.columns())};
}

/// Means are within voxels: with other sizes they would silently be elsewhere.
void check_sizes(const StoredGrid& stored, const VoxelGrid& grid) {
  constexpr double rounding_m = 1e-9;
  if (std::abs(stored.voxel_size_m - grid.voxel_size_m()) <= rounding_m &&
      stored.columns == grid.columns()) {
    return;
  }
  throw TileCodecError("has " + std::to_string(stored.columns) + " voxels of " +
                       std::to_string(stored.voxel_size_m) + " m to a side, its map has " +
                       std::to_string(grid.columns()) + " of " +
                       std::to_string(grid.voxel_size_m()) + " m");
}

template <typename Visitor, typename AnyGrid>
void visit_grid(Visitor&& visit, AnyGrid& grid) {
  visit(grid.voxel_size_m);
  visit(grid.columns);
}

struct TileHeader {
  TileInfo info;
  StoredGrid grid;
  std::uint32_t stamps = 0;
};
constexpr std::size_t tile_header_bytes = 4 + 4 + 8 + 8 + 4 + grid_bytes + 4;

template <typename Visitor, typename Header>
void visit_tile_header(Visitor visit, Header& header) {
  visit(header.info.id.x);
  visit(header.info.id.y);
  visit(header.info.revision);
  visit(header.info.content_hash);
  visit(header.info.voxel_count);
  visit_grid(visit, header.grid);
  visit(header.stamps);
}

struct EvidenceHeader {
  TileId id;
  StoredGrid grid;
  std::uint32_t shown = 0;
  std::uint32_t hidden = 0;
  std::uint32_t hidden_stamps = 0;
  std::uint32_t excluded = 0;
  std::uint32_t excluded_stamps = 0;
};
constexpr std::size_t evidence_header_bytes = 4 + 4 + grid_bytes + 5 * std::size_t{4};

template <typename Visitor, typename Header>
void visit_evidence_header(Visitor visit, Header& header) {
  visit(header.id.x);
  visit(header.id.y);
  visit_grid(visit, header.grid);
  visit(header.shown);
  visit(header.hidden);
  visit(header.hidden_stamps);
  visit(header.excluded);
  visit(header.excluded_stamps);
}

constexpr std::size_t history_bytes = 2 + 2 + 1;
constexpr std::size_t state_bytes = history_bytes + 1;
constexpr std::size_t excluded_bytes = 2 * 2 + 1 + 1 + 4;
/// Stands for no reason.
constexpr std::uint8_t no_reason = 255;

enum Flag : std::uint8_t { was_shown_flag = 1, is_restored_flag = 2, is_thin_flag = 4 };

/// As they are stored: plain numbers.
struct StoredHistory {
  std::uint16_t hits = 0;
  std::uint16_t misses = 0;
  std::uint8_t flags = 0;
};
struct StoredHiddenState {
  StoredHistory history;
  std::uint8_t reason = no_reason;
};
struct StoredExcluded {
  KeySteps::Step step;
  std::uint8_t label = 0;
  std::uint8_t was_moving = 0;
  std::uint32_t stamp = 0;
};

constexpr auto visit_history = [](auto&& visit, auto& history) {
  visit(history.hits);
  visit(history.misses);
  visit(history.flags);
};
constexpr auto visit_state = [](auto&& visit, auto& state) {
  visit_history(visit, state.history);
  visit(state.reason);
};
constexpr auto visit_excluded = [](auto&& visit, auto& excluded) {
  visit(excluded.step.columns);
  visit(excluded.step.layers);
  visit(excluded.label);
  visit(excluded.was_moving);
  visit(excluded.stamp);
};

StoredHistory to_stored(const VoxelHistory& history) {
  const int flags = (history.was_shown ? was_shown_flag : 0) |
                    (history.is_restored ? is_restored_flag : 0) |
                    (history.is_thin ? is_thin_flag : 0);
  return {history.hits, history.misses, static_cast<std::uint8_t>(flags)};
}

StoredHiddenState to_stored(const HiddenState& state) {
  return {to_stored(state.history),
          state.reason ? static_cast<std::uint8_t>(*state.reason) : no_reason};
}

VoxelHistory from_stored(const StoredHistory& stored) {
  if (stored.flags > (was_shown_flag | is_restored_flag | is_thin_flag))
    throw TileCodecError("has unknown flags");
  return {stored.hits, stored.misses, (stored.flags & was_shown_flag) != 0,
          (stored.flags & is_restored_flag) != 0, (stored.flags & is_thin_flag) != 0};
}

HiddenState from_stored(const StoredHiddenState& stored) {
  HiddenState state{from_stored(stored.history), std::nullopt};
  if (stored.reason == no_reason) return state;
  if (stored.reason >= removal_reason_count) throw TileCodecError("has an unknown reason");
  state.reason = static_cast<RemovalReason>(stored.reason);
  return state;
}

template <typename Stored, typename Value>
std::vector<Stored> all_to_stored(const std::vector<Value>& values) {
  std::vector<Stored> stored(values.size());
  std::ranges::transform(values, stored.begin(), [](const Value& v) { return to_stored(v); });
  return stored;
}

/// Reads one list and moves on behind it.
template <std::size_t record_bytes, typename Stored, typename Value, typename Visit>
void read_list(const std::uint8_t*& from, std::size_t count, std::vector<Value>& values,
               Visit visit) {
  values.reserve(count);
  for_each_in_planes<record_bytes, Stored>(
      from, count, visit, [&](const Stored& stored) { values.push_back(from_stored(stored)); });
  from += count * record_bytes;
}

SeenTimes times_of(const std::vector<ExcludedVoxel>& excluded) {
  std::vector<std::int64_t> stamps_ns(excluded.size());
  std::ranges::transform(excluded, stamps_ns.begin(), &ExcludedVoxel::last_seen_ns);
  return seen_times(stamps_ns);
}

void append_excluded(PlaneBytes& content, const std::vector<ExcludedVoxel>& excluded,
                     const SeenTimes& seen) {
  append_stamps(content, seen.stamps_ns);
  std::vector<StoredExcluded> stored;
  KeySteps keys;
  for (std::size_t i = 0; i < excluded.size(); ++i) {
    stored.push_back({keys.step_to(voxel_key(excluded[i].index)),
                      static_cast<std::uint8_t>(excluded[i].label),
                      static_cast<std::uint8_t>(excluded[i].was_moving ? 1 : 0), seen.stamp_of[i]});
  }
  append_planes<excluded_bytes>(content, stored, visit_excluded);
}

std::vector<ExcludedVoxel> read_excluded(const std::uint8_t*& from, const EvidenceHeader& header) {
  const std::vector<std::int64_t> stamps_ns = read_stamps(from, header.excluded_stamps);
  std::vector<ExcludedVoxel> excluded;
  excluded.reserve(header.excluded);
  KeySteps keys;
  const auto keep = [&](const StoredExcluded& one) {
    if (one.label >= semantic_class_count || one.was_moving > 1 || one.stamp >= stamps_ns.size()) {
      throw TileCodecError("has an impossible excluded place");
    }
    excluded.push_back({voxel_index(keys.key_at(one.step)), static_cast<SemanticClass>(one.label),
                        one.was_moving == 1, stamps_ns[one.stamp]});
  };
  for_each_in_planes<excluded_bytes, StoredExcluded>(from, header.excluded, visit_excluded, keep);
  return excluded;
}

void check_content(const std::vector<std::uint8_t>& content, std::size_t needed,
                   const std::string& what) {
  if (content.size() == needed) return;
  throw TileCodecError("has " + what + " of " + std::to_string(content.size()) +
                       " bytes instead of " + std::to_string(needed));
}

/// Every voxel has two at most: more would fill memory for nothing.
void check_stamps(std::size_t stamps, std::size_t max_stamps) {
  if (stamps <= max_stamps) return;
  throw TileCodecError("has " + std::to_string(stamps) + " stamps for at most " +
                       std::to_string(max_stamps));
}

/// The second format had them as they are, and was otherwise the same.
FirstVotes first_votes_in(std::span<const std::uint8_t> frame) {
  return frame[0] <= 2 ? FirstVotes::as_they_are : FirstVotes::by_what_lacks;
}

bool has_thin(const TileEvidence& evidence) {
  return std::ranges::any_of(evidence.shown, &VoxelHistory::is_thin) ||
         std::ranges::any_of(evidence.hidden_states,
                             [](const HiddenState& state) { return state.history.is_thin; });
}

bool is_first_format(std::span<const std::uint8_t> bytes) {
  return !bytes.empty() && bytes[0] == first_tile_format::format_version;
}

}  // namespace

VoxelGrid stored_grid(double voxel_size_m, double tile_size_m) {
  const double columns = tile_size_m / voxel_size_m;
  if (!(voxel_size_m > 0.0 && columns >= 0.5 && columns <= VoxelGrid::max_columns + 0.5)) {
    throw TileCodecError("the map has tiles of " + std::to_string(tile_size_m) +
                         " m with voxels of " + std::to_string(voxel_size_m) + " m");
  }
  return {voxel_size_m, tile_size_m};
}

std::vector<std::uint8_t> encode_tile(const Tile& tile) {
  PlaneBytes content{std::vector<std::uint8_t>(tile_header_bytes), {}};
  const auto stamps_ns = tile.voxels.stamps_ns();
  const TileHeader header{tile.info, to_stored(tile.voxels.grid()),
                          static_cast<std::uint32_t>(stamps_ns.size())};
  visit_tile_header(FieldWriter(content.bytes.data()), header);
  append_stamps(content, stamps_ns);
  append_voxels(content, tile.voxels);
  return to_frame(tile_format, content);
}

Tile decode_tile(std::span<const std::uint8_t> bytes, const VoxelGrid& grid) {
  if (is_first_format(bytes)) return first_tile_format::decode_tile(bytes, grid);
  const std::vector<std::uint8_t> content = from_frame(bytes, tile_header_bytes);
  TileHeader header;
  visit_tile_header(FieldReader(content.data()), header);
  const std::size_t count = header.info.voxel_count;
  check_stamps(header.stamps, 2 * count);
  check_content(content,
                tile_header_bytes + header.stamps * stamp_bytes + count * packed_voxel_bytes,
                std::to_string(count) + " voxels and a content");
  if (count > 0) check_sizes(header.grid, grid);
  const std::uint8_t* from = content.data() + tile_header_bytes;
  std::vector<std::int64_t> stamps_ns = read_stamps(from, header.stamps);
  Tile tile{header.info, read_voxels(from, count, std::move(stamps_ns), header.info.id, grid,
                                     first_votes_in(bytes))};
  tile.info.bounds_map = tile.voxels.bounds_map();
  return tile;
}

std::vector<std::uint8_t> encode_evidence(const TileEvidence& evidence) {
  PlaneBytes content{std::vector<std::uint8_t>(evidence_header_bytes), {}};
  const SeenTimes excluded_times = times_of(evidence.excluded);
  const auto hidden_stamps_ns = evidence.hidden.stamps_ns();
  const EvidenceHeader header{evidence.id,
                              to_stored(evidence.hidden.grid()),
                              static_cast<std::uint32_t>(evidence.shown.size()),
                              static_cast<std::uint32_t>(evidence.hidden.size()),
                              static_cast<std::uint32_t>(hidden_stamps_ns.size()),
                              static_cast<std::uint32_t>(evidence.excluded.size()),
                              static_cast<std::uint32_t>(excluded_times.stamps_ns.size())};
  visit_evidence_header(FieldWriter(content.bytes.data()), header);
  append_planes<history_bytes>(content, all_to_stored<StoredHistory>(evidence.shown),
                               visit_history);
  append_stamps(content, hidden_stamps_ns);
  append_voxels(content, evidence.hidden);
  append_planes<state_bytes>(content, all_to_stored<StoredHiddenState>(evidence.hidden_states),
                             visit_state);
  append_excluded(content, evidence.excluded, excluded_times);
  return to_frame(has_thin(evidence) ? thin_evidence_format : tile_format, content);
}

TileEvidence decode_evidence(std::span<const std::uint8_t> bytes, const VoxelGrid& grid) {
  if (is_first_format(bytes)) return first_tile_format::decode_evidence(bytes, grid);
  const std::vector<std::uint8_t> content = from_frame(bytes, evidence_header_bytes);
  EvidenceHeader header;
  visit_evidence_header(FieldReader(content.data()), header);
  check_stamps(header.hidden_stamps, 2 * std::size_t{header.hidden});
  check_stamps(header.excluded_stamps, header.excluded);
  check_content(content,
                evidence_header_bytes + header.shown * history_bytes +
                    header.hidden_stamps * stamp_bytes +
                    header.hidden * (packed_voxel_bytes + state_bytes) +
                    header.excluded_stamps * stamp_bytes + header.excluded * excluded_bytes,
                "evidence");
  TileEvidence evidence;
  evidence.id = header.id;
  const std::uint8_t* from = content.data() + evidence_header_bytes;
  read_list<history_bytes, StoredHistory>(from, header.shown, evidence.shown, visit_history);
  if (header.hidden > 0) check_sizes(header.grid, grid);
  std::vector<std::int64_t> stamps_ns = read_stamps(from, header.hidden_stamps);
  evidence.hidden = read_voxels(from, header.hidden, std::move(stamps_ns), header.id, grid,
                                first_votes_in(bytes));
  read_list<state_bytes, StoredHiddenState>(from, header.hidden, evidence.hidden_states,
                                            visit_state);
  evidence.excluded = read_excluded(from, header);
  // The format is not under the frame's checksum; these flags are.
  if (has_thin(evidence) && bytes[0] != thin_evidence_format)
    throw TileCodecError("has unknown flags");
  return evidence;
}

}  // namespace stillmap
