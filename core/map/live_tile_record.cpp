// What a live tile is stored as, and how it goes on from that.
#include <algorithm>
#include <cassert>
#include <limits>
#include <type_traits>
#include <utility>

#include "core/map/live_tile.hpp"

namespace stillmap {
namespace {

/// How many scans a voxel's points came from is not known: the most, so that nothing is lost for
/// it.
VoxelHistory history_of_shown(const Voxel& voxel) {
  constexpr std::uint32_t most = std::numeric_limits<std::uint16_t>::max();
  return {.hits = static_cast<std::uint16_t>(std::min(voxel.point_count, most)), .was_shown = true};
}

}  // namespace

LiveTile::LiveTile(TileId id, const TileRecord& record, const VoxelGrid& grid)
    : id_(id), published_(record.tile) {
  const TileEvidence* const evidence = record.evidence.get();
  if (published_) {
    voxels_.reserve(published_->voxels.size() + (evidence ? evidence->hidden.size() : 0));
    for (std::size_t i = 0; i < published_->voxels.size(); ++i) {
      const Voxel& voxel = published_->voxels[i];
      add(voxel, evidence ? evidence->shown[i] : history_of_shown(voxel), grid);
    }
  }
  if (evidence) {
    for (const HiddenVoxel& hidden : evidence->hidden) add(hidden.voxel, hidden.history, grid);
    for (const ExcludedVoxel& voxel : evidence->excluded) {
      excluded_.emplace(voxel_key(voxel.index),
                        Excluded{voxel.label, voxel.was_moving, voxel.last_seen_ns});
    }
  }
  sort_new_voxels();
}

void LiveTile::add(const Voxel& known, const VoxelHistory& history, const VoxelGrid& grid) {
  LiveVoxel live{voxel_key(known.index), known.point_count,  {},     known.evidence,
                 known.first_seen_ns,    known.last_seen_ns, history};
  const Eigen::Vector3d offset =
      (known.mean_map.cast<double>() - grid.corner_map(id_, known.index)) / grid.voxel_size_m();
  const double points = std::min(known.point_count, max_mean_points);
  for (int axis = 0; axis < 3; ++axis) {
    const double steps = std::clamp(offset[axis] * offset_steps - 0.5, 0.0, offset_steps - 1.0);
    live.offset_sum.at(static_cast<std::size_t>(axis)) =
        static_cast<std::uint32_t>(std::lround(steps * points));
  }
  position_.emplace(live.key, static_cast<std::uint32_t>(voxels_.size()));
  voxels_.push_back(live);
}

TileRecord LiveTile::record(const VisibilityRule& rule, const VoxelGrid& grid) const {
  auto evidence = std::make_shared<TileEvidence>();
  evidence->id = id_;
  std::vector<Voxel> shown;
  for (const std::uint32_t position : sorted_) {
    const LiveVoxel& live = voxels_[position];
    if (is_shown(live, rule)) {
      shown.push_back(voxel(live, grid));
      evidence->shown.push_back(live.history);
    } else {
      evidence->hidden.push_back({voxel(live, grid), live.history, removal(live, rule)});
    }
  }
  evidence->excluded.reserve(excluded_.size());
  for (const auto& [key, excluded] : excluded_) {
    evidence->excluded.push_back(
        {voxel_index(key), excluded.label, excluded.was_moving, excluded.last_seen_ns});
  }
  std::ranges::sort(evidence->excluded, {}, &ExcludedVoxel::index);
  if (!published_) return {nullptr, std::move(evidence)};
  assert(shown.size() == published_->voxels.size());
  // As published, with the counts and times of now.
  auto tile = std::make_shared<Tile>(Tile{published_->info, std::move(shown)});
  tile->info.bounds_map.setEmpty();
  for (const Voxel& voxel : tile->voxels) tile->info.bounds_map.extend(voxel.mean_map);
  return {std::move(tile), std::move(evidence)};
}

std::size_t LiveTile::memory_bytes() const {
  const auto table_bytes = [](const auto& table) {
    using Entry = typename std::remove_cvref_t<decltype(table)>::value_type;
    // A bucket has its entry and the distance to its place.
    return table.bucket_count() * (sizeof(Entry) + 4);
  };
  return sizeof(*this) + voxels_.capacity() * sizeof(LiveVoxel) +
         sorted_.capacity() * sizeof(std::uint32_t) + table_bytes(position_) +
         table_bytes(excluded_) + (published_ ? published_->voxels.capacity() * sizeof(Voxel) : 0);
}

}  // namespace stillmap
