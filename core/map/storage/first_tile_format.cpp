#include "core/map/storage/first_tile_format.hpp"

#include <algorithm>
#include <string>

#include "core/map/storage/byte_planes.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "core/map/storage/tile_frame.hpp"

namespace stillmap::first_tile_format {
namespace {

/// A mean is summed in float and may lie a little outside of its cell; at the edge of the map a
/// float is no finer than 8 mm.
constexpr double mean_slack_m = 0.02;

struct StoredVoxel {
  VoxelIndex index;
  std::uint32_t point_count = 0;
  Eigen::Vector3f mean_map = Eigen::Vector3f::Zero();
  std::array<ClassEvidence::Vote, ClassEvidence::candidates> votes{};
  std::int64_t first_seen_ns = 0;
  std::int64_t last_seen_ns = 0;
};
struct StoredHistory {
  std::uint16_t hits = 0;
  std::uint16_t misses = 0;
  std::uint8_t flags = 0;
};
struct StoredHidden {
  StoredVoxel voxel;
  StoredHistory history;
  std::uint8_t reason = 0;
};
struct StoredExcluded {
  VoxelIndex index;
  std::uint8_t label = 0;
  std::uint8_t was_moving = 0;
  std::int64_t last_seen_ns = 0;
};

constexpr std::size_t voxel_bytes = 3 * 2 + 4 + 3 * 4 + ClassEvidence::candidates * (1 + 4) + 16;
constexpr std::size_t history_bytes = 2 + 2 + 1;
constexpr std::size_t hidden_bytes = voxel_bytes + history_bytes + 1;
constexpr std::size_t excluded_bytes = 3 * 2 + 1 + 1 + 8;
constexpr std::size_t tile_header_bytes = 4 + 4 + 8 + 8 + 4;
constexpr std::size_t evidence_header_bytes = 4 + 4 + 3 * 4;
/// Stands for no reason.
constexpr std::uint8_t no_reason = 255;
enum Flag : std::uint8_t { was_shown_flag = 1, is_restored_flag = 2 };

constexpr auto visit_voxel = [](auto&& visit, StoredVoxel& voxel) {
  visit(voxel.index.x);
  visit(voxel.index.y);
  visit(voxel.index.z);
  visit(voxel.point_count);
  for (int axis = 0; axis < 3; ++axis) visit(voxel.mean_map[axis]);
  for (auto& vote : voxel.votes) {
    visit(vote.label);
    visit(vote.weight);
  }
  visit(voxel.first_seen_ns);
  visit(voxel.last_seen_ns);
};
constexpr auto visit_history = [](auto&& visit, StoredHistory& history) {
  visit(history.hits);
  visit(history.misses);
  visit(history.flags);
};
constexpr auto visit_hidden = [](auto&& visit, StoredHidden& hidden) {
  visit_voxel(visit, hidden.voxel);
  visit_history(visit, hidden.history);
  visit(hidden.reason);
};
constexpr auto visit_excluded = [](auto&& visit, StoredExcluded& excluded) {
  visit(excluded.index.x);
  visit(excluded.index.y);
  visit(excluded.index.z);
  visit(excluded.label);
  visit(excluded.was_moving);
  visit(excluded.last_seen_ns);
};

bool is_possible(const StoredVoxel& voxel) {
  return voxel.index.x < VoxelGrid::max_columns && voxel.index.y < VoxelGrid::max_columns &&
         voxel.point_count > 0 && voxel.mean_map.allFinite() &&
         std::ranges::all_of(voxel.votes, [](const ClassEvidence::Vote& vote) {
           return static_cast<std::size_t>(vote.label) < semantic_class_count &&
                  vote.weight >= 0.0F && vote.weight <= ClassEvidence::max_total * 2.0F;
         });
}

bool lies_in_its_cell(const StoredVoxel& voxel, TileId tile, const VoxelGrid& grid) {
  const Eigen::Array3d from_corner =
      voxel.mean_map.cast<double>() - grid.corner_map(tile, voxel.index);
  return (from_corner >= -mean_slack_m).all() &&
         (from_corner <= grid.voxel_size_m() + mean_slack_m).all();
}

Voxel from_stored(const StoredVoxel& stored, TileId tile, const VoxelGrid& grid) {
  if (!is_possible(stored)) throw TileCodecError("has an impossible voxel");
  if (!lies_in_its_cell(stored, tile, grid)) {
    throw TileCodecError("has voxels whose mean lies in another cell");
  }
  return {stored.index,         stored.point_count,
          stored.mean_map,      ClassEvidence::of(stored.votes),
          stored.first_seen_ns, stored.last_seen_ns};
}

VoxelHistory from_stored(const StoredHistory& stored) {
  if (stored.flags > (was_shown_flag | is_restored_flag)) throw TileCodecError("has unknown flags");
  return {stored.hits, stored.misses, (stored.flags & was_shown_flag) != 0,
          (stored.flags & is_restored_flag) != 0};
}

HiddenState state_of(const StoredHidden& stored) {
  HiddenState state{from_stored(stored.history), std::nullopt};
  if (stored.reason == no_reason) return state;
  if (stored.reason >= removal_reason_count) throw TileCodecError("has an unknown reason");
  state.reason = static_cast<RemovalReason>(stored.reason);
  return state;
}

ExcludedVoxel from_stored(const StoredExcluded& stored) {
  if (stored.index.x >= VoxelGrid::max_columns || stored.index.y >= VoxelGrid::max_columns ||
      stored.label >= semantic_class_count || stored.was_moving > 1) {
    throw TileCodecError("has an impossible excluded place");
  }
  return {stored.index, static_cast<SemanticClass>(stored.label), stored.was_moving == 1,
          stored.last_seen_ns};
}

/// Reads one list and moves on behind it.
template <std::size_t record_bytes, typename Stored, typename Visit>
std::vector<Stored> read_list(const std::uint8_t*& from, std::uint32_t count, Visit visit) {
  auto stored = read_planes<record_bytes, Stored>(from, count, visit);
  from += count * record_bytes;
  return stored;
}

constexpr int content_steps = 8;

/// The eighth of the voxel that the mean lies in, as the hash of the first format has it.
Eigen::Array3i content_step(const Voxel& voxel, TileId tile, const VoxelGrid& grid) {
  const Eigen::Array3d offset =
      (voxel.mean_map.cast<double>() - grid.corner_map(tile, voxel.index)) / grid.voxel_size_m();
  return (offset * content_steps).floor().max(0.0).min(content_steps - 1.0).cast<int>();
}

Eigen::Array3i content_step(const PackedVoxel& voxel) {
  const auto mean = static_cast<int>(content_word(voxel) >> 5 & 0x1FFU);
  return {mean / (content_steps * content_steps), mean / content_steps % content_steps,
          mean % content_steps};
}

/// Rounded within the eighth of the voxel, so that the content hash stays.
PackedVoxel packed(const Voxel& voxel, TileId tile, const VoxelGrid& grid) {
  PackedVoxel packed = pack(voxel, tile, grid);
  const Eigen::Array3i wanted = content_step(voxel, tile, grid);
  for (int axis = 0; axis < 3; ++axis) {
    std::uint16_t& sum = packed.offset_sum.at(static_cast<std::size_t>(axis));
    while (content_step(packed)[axis] > wanted[axis]) --sum;
    while (content_step(packed)[axis] < wanted[axis]) ++sum;
  }
  return packed;
}

PackedVoxels packed(const std::vector<Voxel>& voxels, TileId tile, const VoxelGrid& grid) {
  const auto not_ascending = [](const Voxel& a, const Voxel& b) { return a.index >= b.index; };
  if (std::ranges::adjacent_find(voxels, not_ascending) != voxels.end()) {
    throw TileCodecError("has voxels out of order");
  }
  std::vector<PackedVoxel> all;
  std::vector<std::int64_t> stamps_ns;
  all.reserve(voxels.size());
  stamps_ns.reserve(2 * voxels.size());
  for (const Voxel& voxel : voxels) {
    all.push_back(packed(voxel, tile, grid));
    stamps_ns.push_back(voxel.first_seen_ns);
    stamps_ns.push_back(voxel.last_seen_ns);
  }
  return {tile, grid, std::move(all), seen_times(stamps_ns)};
}

}  // namespace

Tile decode_tile(std::span<const std::uint8_t> frame, const VoxelGrid& grid) {
  const auto content = from_frame(frame, tile_header_bytes);
  Tile tile;
  FieldReader header(content.data());
  header(tile.info.id.x);
  header(tile.info.id.y);
  header(tile.info.revision);
  header(tile.info.content_hash);
  header(tile.info.voxel_count);
  const std::size_t count = tile.info.voxel_count;
  if (content.size() != tile_header_bytes + count * voxel_bytes) {
    throw TileCodecError("has " + std::to_string(content.size()) + " bytes for " +
                         std::to_string(count) + " voxels");
  }
  const std::uint8_t* from = content.data() + tile_header_bytes;
  std::vector<Voxel> voxels;
  voxels.reserve(count);
  for (const auto& stored :
       read_list<voxel_bytes, StoredVoxel>(from, tile.info.voxel_count, visit_voxel)) {
    voxels.push_back(from_stored(stored, tile.info.id, grid));
  }
  tile.voxels = packed(voxels, tile.info.id, grid);
  tile.info.bounds_map = tile.voxels.bounds_map();
  return tile;
}

TileEvidence decode_evidence(std::span<const std::uint8_t> frame, const VoxelGrid& grid) {
  const auto content = from_frame(frame, evidence_header_bytes);
  TileEvidence evidence;
  std::array<std::uint32_t, 3> counts{};
  FieldReader header(content.data());
  header(evidence.id.x);
  header(evidence.id.y);
  for (auto& count : counts) header(count);
  const std::size_t needed = evidence_header_bytes + std::size_t{counts[0]} * history_bytes +
                             std::size_t{counts[1]} * hidden_bytes +
                             std::size_t{counts[2]} * excluded_bytes;
  if (content.size() != needed) {
    throw TileCodecError("has evidence of " + std::to_string(content.size()) +
                         " bytes instead of " + std::to_string(needed));
  }
  const std::uint8_t* from = content.data() + evidence_header_bytes;
  for (const auto& shown : read_list<history_bytes, StoredHistory>(from, counts[0], visit_history))
    evidence.shown.push_back(from_stored(shown));
  std::vector<Voxel> hidden;
  for (const auto& stored : read_list<hidden_bytes, StoredHidden>(from, counts[1], visit_hidden)) {
    hidden.push_back(from_stored(stored.voxel, evidence.id, grid));
    evidence.hidden_states.push_back(state_of(stored));
  }
  evidence.hidden = packed(hidden, evidence.id, grid);
  for (const auto& stored :
       read_list<excluded_bytes, StoredExcluded>(from, counts[2], visit_excluded)) {
    evidence.excluded.push_back(from_stored(stored));
  }
  return evidence;
}

}  // namespace stillmap::first_tile_format
