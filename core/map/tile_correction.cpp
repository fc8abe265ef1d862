#include "core/map/tile_correction.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <numbers>
#include <utility>

#include "core/map/packed_voxels.hpp"

namespace stillmap {
namespace {

/// Means of voxels have steps of 1/256 of them.
constexpr double min_shift_voxels = 0.02;

constexpr std::uint32_t max_count = std::numeric_limits<std::uint16_t>::max();

std::uint16_t capped_sum(std::uint16_t a, std::uint16_t b) {
  return static_cast<std::uint16_t>(std::min(std::uint32_t{a} + b, max_count));
}

ClassEvidence sum_of(const ClassEvidence& a, const ClassEvidence& b) {
  std::array<ClassEvidence::Vote, 2 * ClassEvidence::candidates> all{};
  std::size_t count = 0;
  for (const ClassEvidence& evidence : {a, b}) {
    for (const ClassEvidence::Vote& vote : evidence.votes()) {
      if (!(vote.weight > 0.0F)) continue;
      const auto end = all.begin() + static_cast<std::ptrdiff_t>(count);
      const auto same = std::find_if(all.begin(), end,
                                     [&](const auto& known) { return known.label == vote.label; });
      if (same == end) {
        all.at(count++) = vote;
      } else {
        same->weight += vote.weight;
      }
    }
  }
  std::ranges::stable_sort(all, std::ranges::greater{}, &ClassEvidence::Vote::weight);
  std::array<ClassEvidence::Vote, ClassEvidence::candidates> strongest{};
  std::ranges::copy_n(all.begin(), ClassEvidence::candidates, strongest.begin());
  return ClassEvidence::of(strongest);
}

}  // namespace

TileCorrection::TileCorrection(const MapCorrection& correction, const VoxelGrid& grid,
                               const ScanStamps& stamps, std::function<bool(TileId)> is_open,
                               std::uint64_t number)
    : correction_(correction), grid_(grid), stamps_(stamps), is_open_(std::move(is_open)) {
  // Evenly spread over numbers that follow each other, of each axis: multiples of the golden ratio.
  const Eigen::Array3d places = Eigen::Array3d(0.0, 1.0 / 3.0, 2.0 / 3.0) +
                                std::numbers::phi * static_cast<double>(number % 1'000'000);
  rounding_m_ = grid_.voxel_size_m() * (places - places.floor() - 0.5).matrix();
}

std::optional<Eigen::Vector3d> TileCorrection::new_position(const Eigen::Vector3d& position_map,
                                                            std::uint32_t scan) const {
  const Eigen::Isometry3d* const T_new_old = correction_.at(stamps_.stamp_ns(scan));
  if (T_new_old == nullptr) return std::nullopt;
  const Eigen::Vector3d moved = *T_new_old * position_map;
  // Poses that are to stay have the identity. What was seen from the others goes along with them,
  // however near it lies, or it would stay behind with every correction.
  if ((moved - position_map).norm() < min_shift_voxels * grid_.voxel_size_m() ||
      !grid_.holds(moved))
    return std::nullopt;
  if (!is_open_(grid_.index(moved).tile)) return std::nullopt;
  return moved;
}

std::optional<TileCorrection::Voxel> TileCorrection::moved(const LiveTile& tile,
                                                           const LiveTile::LiveVoxel& voxel) const {
  if (voxel.packed.point_count == 0) return std::nullopt;
  const Eigen::Vector3d mean_map = tile.mean_map(voxel).cast<double>();
  const auto position = new_position(mean_map, voxel.first_scan);
  if (!position) return std::nullopt;
  const VoxelGrid::Index index = grid_.index(*position);
  Voxel moved;
  moved.tile = index.tile;
  moved.live = voxel;
  moved.mean_map = position->cast<float>();
  const Eigen::Vector3d by_whole =
      tile.centre_map(voxel.packed.key).cast<double>() +
      grid_.voxel_size_m() *
          Eigen::Vector3d(((*position - mean_map) / grid_.voxel_size_m()).array().round());
  const VoxelGrid::Index home = grid_.holds(by_whole) ? grid_.index(by_whole) : index;
  moved.tile_by_whole = home.tile;
  moved.key_by_whole = voxel_key(home.voxel);
  moved.live.packed = pack({.index = index.voxel,
                            .point_count = voxel.packed.point_count,
                            .mean_map = moved.mean_map,
                            .evidence = voxel.packed.evidence},
                           index.tile, grid_);
  return moved;
}

std::optional<TileCorrection::Place> TileCorrection::moved(
    const LiveTile& tile, std::uint32_t key, const LiveTile::Excluded& excluded) const {
  const auto position = new_position(tile.centre_map(key).cast<double>(), excluded.last_scan);
  if (!position) return std::nullopt;
  const Eigen::Vector3d rounded = *position + rounding_m_;
  const VoxelGrid::Index index = grid_.index(grid_.holds(rounded) ? rounded : *position);
  if (!is_open_(index.tile)) return std::nullopt;
  return Place{index.tile, voxel_key(index.voxel), excluded};
}

TileCorrection::Moved TileCorrection::take(LiveTile& tile) const {
  tile.sort_fresh();
  Moved taken;
  std::vector<LiveTile::LiveVoxel> kept;
  kept.reserve(tile.sorted_.size());
  for (const LiveTile::LiveVoxel& voxel : tile.sorted_) {
    if (auto elsewhere = moved(tile, voxel)) {
      taken.voxels.push_back(*elsewhere);
    } else {
      kept.push_back(voxel);
    }
  }
  if (!taken.voxels.empty()) {
    kept.shrink_to_fit();
    taken.voxels.shrink_to_fit();
    tile.sorted_ = std::move(kept);
    tile.index_.rebuild(tile.sorted_.size(), tile.sorted_.size(), tile.key_at());
  }
  for (const auto& [key, excluded] : tile.excluded_)
    if (const auto elsewhere = moved(tile, key, excluded)) taken.places.push_back(*elsewhere);
  if (!taken.places.empty()) {
    auto stays = std::exchange(tile.excluded_, {});
    for (const auto& [key, excluded] : stays)
      if (!moved(tile, key, excluded)) tile.excluded_.emplace(key, excluded);
  }
  return taken;
}

void TileCorrection::put(LiveTile& tile, Moved moved) const {
  std::ranges::stable_sort(moved.voxels, {},
                           [](const Voxel& voxel) { return voxel.live.packed.key; });
  std::vector<std::uint32_t> homes;
  for (const Voxel& voxel : moved.voxels)
    if (voxel.tile_by_whole == tile.id()) homes.push_back(voxel.key_by_whole);
  std::ranges::sort(homes);
  const std::size_t unmoved = tile.size();
  for (const Voxel& voxel : moved.voxels) {
    const std::uint32_t position = tile.index_.find(voxel.live.packed.key, tile.key_at());
    const bool meets_unmoved = position < unmoved;
    const bool is_taken =
        position != PositionIndex::none || std::ranges::binary_search(homes, voxel.live.packed.key);
    const bool goes_home = is_taken && !meets_unmoved && voxel.tile_by_whole == tile.id();
    put(tile, goes_home ? at_home(voxel) : voxel);
  }
  for (const Place& place : moved.places) {
    if (tile.index_.find(place.key, tile.key_at()) == PositionIndex::none)
      tile.excluded_.insert_or_assign(place.key, place.excluded);
  }
}

TileCorrection::Voxel TileCorrection::at_home(const Voxel& voxel) const {
  Voxel home = voxel;
  home.live.packed = pack({.index = voxel_index(voxel.key_by_whole),
                           .point_count = voxel.live.packed.point_count,
                           .mean_map = voxel.mean_map,
                           .evidence = voxel.live.packed.evidence},
                          voxel.tile_by_whole, grid_);
  return home;
}

void TileCorrection::put(LiveTile& tile, const Voxel& voxel) const {
  const std::uint32_t key = voxel.live.packed.key;
  tile.first_seen_ns_ = std::min(tile.first_seen_ns_, stamps_.stamp_ns(voxel.live.first_scan));
  const std::uint32_t position = tile.index_.find(key, tile.key_at());
  if (position != PositionIndex::none) return merge(tile, tile.at(position), voxel);
  if (tile.size() >= PositionIndex::max_entries) return;
  tile.excluded_.erase(key);
  tile.add_fresh(key) = voxel.live;
}

void TileCorrection::merge(const LiveTile& tile, LiveTile::LiveVoxel& known,
                           const Voxel& other) const {
  const LiveTile::LiveVoxel& added = other.live;
  const auto share = static_cast<float>(added.packed.mean_points()) /
                     static_cast<float>(added.packed.mean_points() + known.packed.mean_points());
  const Eigen::Vector3f mean_map =
      known.packed.point_count == 0
          ? stillmap::mean_map(added.packed, tile.id(), grid_)
          : Eigen::Vector3f((1.0F - share) * tile.mean_map(known) +
                            share * stillmap::mean_map(added.packed, tile.id(), grid_));
  known.packed =
      pack({.index = voxel_index(known.packed.key),
            .point_count = capped_sum(known.packed.point_count, added.packed.point_count),
            .mean_map = mean_map,
            .evidence = sum_of(known.packed.evidence, added.packed.evidence)},
           tile.id(), grid_);
  const auto earlier = [this](std::uint32_t a, std::uint32_t b) {
    return stamps_.stamp_ns(a) < stamps_.stamp_ns(b);
  };
  if (earlier(added.first_scan, known.first_scan)) known.first_scan = added.first_scan;
  if (earlier(known.last_scan, added.last_scan)) known.last_scan = added.last_scan;
  known.misses = std::min<std::uint16_t>(known.misses, added.misses) & 0x1FFFU;
  known.hits = capped_sum(known.hits, added.hits);
  known.is_thin |= added.is_thin;
  known.was_shown |= added.was_shown;
  known.is_restored |= added.is_restored;
}

}  // namespace stillmap
