#include "core/session/map_merge.hpp"

#include <tsl/robin_map.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "core/lidar/direction_cells.hpp"
#include "core/lidar/voxel_index.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

constexpr float max_view_m = 40.0F;
constexpr float min_view_m = 1.0F;
/// A path may be of the wheels: from a little above it, the ground hides less.
constexpr double view_height_m = 1.0;
/// Views are so far apart along the path.
constexpr double view_spacing_m = 1.0;

/// How far off what is seen in each direction is.
class DepthImage {
 public:
  DepthImage() : depth_m_(DirectionCell::count, std::numeric_limits<float>::infinity()) {}

  /// Hides what is behind a voxel of this size.
  void add(const Eigen::Vector3f& p_lidar, float voxel_size_m) {
    constexpr float max_cells = 8.0F;
    const float range = p_lidar.norm();
    const int reach = static_cast<int>(
        std::lround(std::min(0.5F * voxel_size_m / range * DirectionCell::per_rad, max_cells)));
    const auto [column, row] = DirectionCell::of(p_lidar);
    for (int r = row - reach; r <= row + reach; ++r) {
      for (int c = column - reach; c <= column + reach; ++c) {
        float& depth = depth_m_[DirectionCell{c, r}.index()];
        depth = std::min(depth, range);
      }
    }
  }
  [[nodiscard]] bool shows(const Eigen::Vector3f& p_lidar) const {
    const float range = p_lidar.norm();
    // Beside a voxel of the ground lies more of it.
    return range < depth_m_[DirectionCell::of(p_lidar).index()] + 0.5F + 0.08F * range;
  }

 private:
  std::vector<float> depth_m_;
};

/// A voxel of one map or both, on its way into a tile.
struct MergedVoxel {
  Voxel voxel;
  VoxelHistory history;
};
struct MergedTile {
  tsl::robin_map<std::uint32_t, MergedVoxel, IndexHash> voxels;
  tsl::robin_map<std::uint32_t, ExcludedVoxel, IndexHash> excluded;
};

std::uint16_t sum_of(std::uint16_t a, std::uint16_t b, unsigned max) {
  return static_cast<std::uint16_t>(std::min(unsigned{a} + b, max));
}

/// That one map has it as the rest of something that moved on says nothing against what the other
/// one saw there.
std::uint16_t misses_of_both(std::uint16_t a, std::uint16_t b) {
  constexpr std::uint16_t of_rest = VoxelHistory::misses_of_rest;
  if (a == of_rest || b == of_rest) return std::min(a, b);
  return sum_of(a, b, VoxelHistory::max_misses);
}

ClassEvidence sum_of(const ClassEvidence& a, const ClassEvidence& b) {
  std::array<float, semantic_class_count> weights{};
  for (const ClassEvidence* const evidence : {&a, &b})
    for (const ClassEvidence::Vote& vote : evidence->votes())
      weights.at(static_cast<std::size_t>(vote.label)) += vote.weight;
  std::array<ClassEvidence::Vote, ClassEvidence::candidates> votes{};
  for (ClassEvidence::Vote& vote : votes) {
    const auto heaviest = std::ranges::max_element(weights);
    if (*heaviest <= 0.0F) break;
    vote = {static_cast<SemanticClass>(heaviest - weights.begin()), *heaviest};
    *heaviest = 0.0F;
  }
  return ClassEvidence::of(votes);
}

void add_to(MergedTile& tile, const MergedVoxel& more) {
  const auto [place, is_new] = tile.voxels.try_emplace(voxel_key(more.voxel.index), more);
  if (is_new) return;
  constexpr std::uint32_t max_points = std::numeric_limits<std::uint16_t>::max();
  Voxel& voxel = place.value().voxel;
  VoxelHistory& history = place.value().history;
  const auto weight = static_cast<float>(more.voxel.point_count);
  const auto all = static_cast<float>(voxel.point_count) + weight;
  voxel.mean_map += (weight / std::max(all, 1.0F)) * (more.voxel.mean_map - voxel.mean_map);
  voxel.point_count = std::min(voxel.point_count + more.voxel.point_count, max_points);
  voxel.evidence = sum_of(voxel.evidence, more.voxel.evidence);
  voxel.first_seen_ns = std::min(voxel.first_seen_ns, more.voxel.first_seen_ns);
  voxel.last_seen_ns = std::max(voxel.last_seen_ns, more.voxel.last_seen_ns);
  history.hits = sum_of(history.hits, more.history.hits, max_points);
  history.misses = misses_of_both(history.misses, more.history.misses);
  history.was_shown |= more.history.was_shown;
  history.is_restored |= more.history.is_restored;
  history.is_thin |= more.history.is_thin;
}

/// Calls `take` with every voxel of a tile, whether it is shown or not.
template <typename Take>
void for_each_voxel(const Tile* tile, const TileEvidence* evidence, Take take) {
  for (std::size_t i = 0; tile != nullptr && i < tile->voxels.size(); ++i) {
    const Voxel voxel = tile->voxels[i];
    VoxelHistory history{.hits = static_cast<std::uint16_t>(voxel.point_count), .was_shown = true};
    take(MergedVoxel{voxel, evidence == nullptr ? history : evidence->shown[i]});
  }
  for (std::size_t i = 0; evidence != nullptr && i < evidence->hidden.size(); ++i)
    take(MergedVoxel{evidence->hidden[i], evidence->hidden_states[i].history});
}

const TileEvidence* evidence_of(const SavedMap& map, TileId id) {
  const auto found = map.tile_evidence.find(id);
  return found == map.tile_evidence.end() ? nullptr : found->second.get();
}

/// Tiles that show something or not.
std::vector<TileId> tile_ids(const SavedMap& map) {
  std::vector<TileId> ids;
  for (const auto& tile : map.view.tiles) ids.push_back(tile->info.id);
  for (const auto& [id, evidence] : map.tile_evidence)
    if (map.view.tiles.find(id) == nullptr) ids.push_back(id);
  return ids;
}

/// Moves what the other map has into tiles of this one.
class Mover {
 public:
  Mover(const SavedMap& other, const std::vector<Eigen::Isometry3d>& T_map_pose,
        std::int64_t clock_offset_ns, const VoxelGrid& grid)
      : clock_offset_ns_(clock_offset_ns), grid_(grid) {
    for (std::size_t i = 0; i < other.trajectory.size(); ++i) {
      const StampedPose& pose = other.trajectory[i];
      corrections_.push_back({pose.stamp_ns, T_map_pose[i] * pose.T_map_lidar.inverse()});
    }
    // Of several runs, whose clocks may have begun anew.
    std::ranges::stable_sort(corrections_, {}, &Correction::stamp_ns);
  }

  void add(MergedVoxel merged, std::map<TileId, MergedTile>& tiles) const {
    Voxel& voxel = merged.voxel;
    const Eigen::Vector3d p = correction_at(voxel.last_seen_ns) * voxel.mean_map.cast<double>();
    if (!grid_.holds(p)) return;
    const VoxelGrid::Index index = grid_.index(p);
    voxel.index = index.voxel;
    voxel.mean_map = p.cast<float>();
    voxel.first_seen_ns += clock_offset_ns_;
    voxel.last_seen_ns += clock_offset_ns_;
    add_to(tiles[index.tile], merged);
  }
  void add(TileId id, ExcludedVoxel voxel, std::map<TileId, MergedTile>& tiles) const {
    const Eigen::Vector3d centre =
        grid_.corner_map(id, voxel.index).array() + 0.5 * grid_.voxel_size_m();
    const Eigen::Vector3d p = correction_at(voxel.last_seen_ns) * centre;
    if (!grid_.holds(p)) return;
    const VoxelGrid::Index index = grid_.index(p);
    voxel.index = index.voxel;
    voxel.last_seen_ns += clock_offset_ns_;
    tiles[index.tile].excluded.insert_or_assign(voxel_key(voxel.index), voxel);
  }

 private:
  struct Correction {
    std::int64_t stamp_ns = 0;
    Eigen::Isometry3d T_map_other;
  };

  [[nodiscard]] const Eigen::Isometry3d& correction_at(std::int64_t stamp_ns) const {
    const auto found = std::ranges::lower_bound(corrections_, stamp_ns, {}, &Correction::stamp_ns);
    return (found == corrections_.end() ? corrections_.back() : *found).T_map_other;
  }

  std::int64_t clock_offset_ns_;
  VoxelGrid grid_;
  /// Of the other map's path, sorted.
  std::vector<Correction> corrections_;
};

/// All of it as hidden: what is to be shown the map itself decides.
std::shared_ptr<const TileEvidence> to_evidence(TileId id, const MergedTile& merged,
                                                const VoxelGrid& grid) {
  std::vector<MergedVoxel> sorted;
  for (const auto& [key, voxel] : merged.voxels) sorted.push_back(voxel);
  std::ranges::sort(sorted, {}, [](const MergedVoxel& voxel) { return voxel.voxel.index; });
  auto evidence = std::make_shared<TileEvidence>();
  evidence->id = id;
  std::vector<Voxel> voxels;
  for (const MergedVoxel& voxel : sorted) {
    voxels.push_back(voxel.voxel);
    evidence->hidden_states.push_back({voxel.history, std::nullopt});
  }
  evidence->hidden = PackedVoxels(id, grid, voxels);
  for (const auto& [key, voxel] : merged.excluded)
    if (!merged.voxels.contains(key)) evidence->excluded.push_back(voxel);
  std::ranges::sort(evidence->excluded, {}, &ExcludedVoxel::index);
  return evidence;
}

/// A voxel that the map shows has so many points.
std::uint32_t least_points_shown(const SavedMap& map) {
  std::optional<std::uint32_t> least;
  for (const auto& tile : map.view.tiles)
    for (const PackedVoxel& voxel : tile->voxels.packed())
      least = std::min<std::uint32_t>(least.value_or(voxel.point_count), voxel.point_count);
  return std::max(least.value_or(1U), 1U);
}

}  // namespace

LabelledScan view_of_map(const std::vector<LabelledPoint>& points_map,
                         const Eigen::Isometry3d& T_map_lidar, double voxel_size_m) {
  const Eigen::Isometry3d T_lidar_map = T_map_lidar.inverse();
  std::vector<LabelledPoint> near;
  DepthImage depth;
  for (const LabelledPoint& point : points_map) {
    const Eigen::Vector3f p = (T_lidar_map * point.position_map.cast<double>()).cast<float>();
    const float range = p.norm();
    if (range < min_view_m || range > max_view_m) continue;
    near.push_back({p, point.label});
    depth.add(p, static_cast<float>(voxel_size_m));
  }
  LabelledScan view;
  for (const LabelledPoint& point : near) {
    if (!depth.shows(point.position_map)) continue;
    view.scan.points_lidar.push_back(point.position_map);
    view.labels.classes.push_back(point.label);
  }
  view.labels.confidence.assign(view.scan.size(), 1.0F);
  view.motion.assign(view.scan.size(), Motion::stationary);
  return view;
}

MapAlignment align_maps(const std::shared_ptr<const PlaceIndex>& map, const PlaceIndex& other,
                        const SharedTrajectory& other_path, double voxel_size_m) {
  const Eigen::Isometry3d up(Eigen::Translation3d(0.0, 0.0, view_height_m));
  std::vector<Eigen::Isometry3d> T_other_view;
  for (const StampedPose& pose : other_path) T_other_view.push_back(pose.T_map_lidar * up);
  const auto view_at = [&](std::size_t k) {
    const Eigen::Isometry3d& T = T_other_view[k];
    return view_of_map(other.points_near(T.translation().head<2>(), max_view_m), T, voxel_size_m);
  };
  LoopCloser drive{LoopClosingConfig{}};
  std::size_t last = 0;
  for (std::size_t k = 0; k < T_other_view.size(); ++k) {
    const bool is_view =
        k == 0 ||
        (T_other_view[k].translation() - T_other_view[last].translation()).norm() >= view_spacing_m;
    if (is_view) last = k;
    drive.add(is_view ? view_at(k) : LabelledScan{}, T_other_view[k], is_view);
  }
  drive.finish();
  MapAlignment alignment = MapAligner(map).align(drive, view_at, Eigen::Matrix3d::Identity());
  for (Eigen::Isometry3d& T : alignment.T_map_lidar) T = T * up.inverse();
  for (auto* const list : {&alignment.closures, &alignment.refused})
    for (MapClosure& closure : *list) closure.T_map_lidar = closure.T_map_lidar * up.inverse();
  return alignment;
}

SavedMap merged_map(const SavedMap& map, const SavedMap& other,
                    const std::vector<Eigen::Isometry3d>& T_map_pose, std::int64_t clock_offset_ns,
                    StaticMapConfig config) {
  assert(T_map_pose.size() == other.trajectory.size());
  const VoxelGrid grid(map.view.voxel_size_m, map.view.tile_size_m);
  const Mover mover(other, T_map_pose, clock_offset_ns, grid);
  std::map<TileId, MergedTile> tiles;
  for (const TileId id : tile_ids(other)) {
    const TileEvidence* const evidence = evidence_of(other, id);
    for_each_voxel(other.view.tiles.find(id).get(), evidence,
                   [&](const MergedVoxel& voxel) { mover.add(voxel, tiles); });
    if (evidence == nullptr) continue;
    for (const ExcludedVoxel& voxel : evidence->excluded) mover.add(id, voxel, tiles);
  }
  TileEvidenceMap changed;
  for (auto& [id, tile] : tiles) {
    const TileEvidence* const evidence = evidence_of(map, id);
    for_each_voxel(map.view.tiles.find(id).get(), evidence,
                   [&tile = tile](const MergedVoxel& voxel) { add_to(tile, voxel); });
    if (evidence != nullptr) {
      for (const ExcludedVoxel& voxel : evidence->excluded)
        tile.excluded.try_emplace(voxel_key(voxel.index), voxel);
    }
    changed.emplace(id, to_evidence(id, tile, grid));
  }
  config.voxel_size_m = map.view.voxel_size_m;
  config.tile_size_m = map.view.tile_size_m;
  config.min_points = std::max(config.min_points, least_points_shown(map));
  StaticMap decided(config);
  MapSnapshot none = map.view;
  none.tiles = {};
  decided.resume(none, changed);
  SavedMap merged = to_saved_map(decided.checkpoint(CheckpointScope::everything));
  merged.is_partial = true;
  merged.trajectory = map.trajectory;
  for (std::size_t i = 0; i < T_map_pose.size(); ++i)
    merged.trajectory.push_back({other.trajectory[i].stamp_ns + clock_offset_ns, T_map_pose[i]});
  return merged;
}

}  // namespace stillmap
