#pragma once

#include <tsl/robin_map.h>

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/lidar/brick_index.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/voxel_index.hpp"
#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {

/// Column, row and layer in 32 bits; keys sort as indices do.
[[nodiscard]] std::uint32_t voxel_key(VoxelIndex index);
[[nodiscard]] VoxelIndex voxel_index(std::uint32_t key);

/// A point on its way into a tile.
struct TilePoint {
  std::uint32_t voxel_key = 0;
  /// From the voxel's lowest corner, in 1/1024 voxel.
  std::array<std::uint16_t, 3> offset{};
  SemanticClass label = SemanticClass::unlabeled;
  /// Semi-static points add evidence to existing voxels and create none; of highly dynamic points
  /// only the place is recorded.
  Motion motion = Motion::stationary;
  float confidence = 0.0F;
};

/// When a voxel is shown.
struct VisibilityRule {
  /// Points that it was hit by.
  std::uint32_t min_points = 2;
  /// It is hidden once this many scans saw through it, and this many for each scan that hit it.
  std::uint32_t misses_to_clear = 4;
  std::uint32_t misses_per_hit = 2;
};

/// The mutable side of a tile: all evidence so far, also of voxels that no snapshot shows yet.
class LiveTile {
 public:
  explicit LiveTile(TileId id) : id_(id) {}
  /// Restores a tile from its record.
  LiveTile(TileId id, const TileRecord& record, const VoxelGrid& grid);

  void insert(std::span<const TilePoint> points, std::int64_t stamp_ns);

  /// Counts a miss for each voxel that the scan saw through; `is_free` tells whether a ray passed a
  /// position (map frame). True when this hides a voxel.
  [[nodiscard]] bool clear_seen_through(const std::function<bool(const Eigen::Vector3f&)>& is_free,
                                        std::int64_t stamp_ns, const VisibilityRule& rule,
                                        const VoxelGrid& grid);

  /// Of the voxel; no votes when there is no such voxel.
  [[nodiscard]] ClassEvidence evidence(std::uint32_t voxel_key) const;

  /// Publishes the voxels that the rule shows and whose class is not a movable one. False, and the
  /// published tile stays, when the content is the same as before.
  [[nodiscard]] bool publish(std::uint64_t revision, const VisibilityRule& rule,
                             const VoxelGrid& grid);

  /// What was hit and is not shown, in no order.
  [[nodiscard]] std::vector<RemovedVoxel> removed(const VisibilityRule& rule,
                                                  const VoxelGrid& grid) const;
  /// Shows the voxels that are hidden for this reason, whatever is seen of them later. Returns how
  /// many.
  std::size_t restore(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                      const VisibilityRule& rule, const VoxelGrid& grid);

  /// Whether what is published differs by more than a few voxels from what was stored last. A
  /// standing lidar finds a new voxel now and then, at the edge of its noise.
  [[nodiscard]] bool view_has_changed() const { return unrecorded_voxels_ >= min_changed_voxels; }
  /// A record of the tile is to be stored.
  void begin_recording() { recording_voxels_ = unrecorded_voxels_; }
  /// It is stored.
  void end_recording() { unrecorded_voxels_ -= std::exchange(recording_voxels_, 0); }

  /// The complete state. Requires that the tile did not change since `publish`.
  [[nodiscard]] TileRecord record(const VisibilityRule& rule, const VoxelGrid& grid) const;

  /// Memory in use, the published tile included.
  [[nodiscard]] std::size_t memory_bytes() const;

  [[nodiscard]] TileId id() const { return id_; }
  /// Shared by snapshots; null while no voxel is shown.
  [[nodiscard]] const std::shared_ptr<const Tile>& published() const { return published_; }

 private:
  /// Steps of a point's offset in a voxel.
  static constexpr double offset_steps = 1024.0;
  /// The mean is not updated beyond this count: the sum would overflow 32 bits.
  static constexpr std::uint32_t max_mean_points = 1U << 22;
  static constexpr std::size_t min_changed_voxels = 16;

  /// Sums are whole numbers, so that the mean does not depend on the order of points.
  struct LiveVoxel {
    std::uint32_t key = 0;
    std::uint32_t point_count = 0;
    std::array<std::uint32_t, 3> offset_sum{};
    ClassEvidence evidence;
    std::int64_t first_seen_ns = 0;
    std::int64_t last_seen_ns = 0;
    VoxelHistory history;
  };
  /// A voxel that only movable objects hit.
  struct Excluded {
    SemanticClass label = SemanticClass::unlabeled;
    bool was_moving = false;
    std::int64_t last_seen_ns = 0;
  };

  void add(const Voxel& known, const VoxelHistory& history, const VoxelGrid& grid);
  /// Position in `voxels_` of the point's voxel, made where a point may make one; else
  /// BrickIndex::none, and what stays out is recorded.
  [[nodiscard]] std::uint32_t find(const TilePoint& point, std::uint32_t& brick,
                                   std::int64_t stamp_ns);
  void remember(std::uint32_t voxel_key, std::uint32_t position);
  void insert_block(std::span<const TilePoint> points, std::int64_t stamp_ns);
  static void hit(LiveVoxel& voxel, const TilePoint& point, std::int64_t stamp_ns);
  void exclude(const TilePoint& point, std::int64_t stamp_ns);
  std::size_t restore_excluded(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                               const VisibilityRule& rule, const VoxelGrid& grid);
  [[nodiscard]] static bool is_seen_through(const LiveVoxel& voxel, const VisibilityRule& rule);
  [[nodiscard]] static bool is_shown(const LiveVoxel& voxel, const VisibilityRule& rule);
  /// Nothing for voxels that are shown, or were hit too rarely to be.
  [[nodiscard]] static std::optional<RemovalReason> removal(const LiveVoxel& voxel,
                                                            const VisibilityRule& rule);
  [[nodiscard]] Eigen::Vector3f mean_map(const LiveVoxel& live, const VoxelGrid& grid) const;
  [[nodiscard]] Eigen::Vector3f centre_map(std::uint32_t key, const VoxelGrid& grid) const;
  [[nodiscard]] static RemovalReason reason_of(const Excluded& excluded);
  void sort_new_voxels();
  [[nodiscard]] Voxel voxel(const LiveVoxel& live, const VoxelGrid& grid) const;
  [[nodiscard]] std::vector<Voxel> visible_voxels(const VisibilityRule& rule,
                                                  const VoxelGrid& grid);

  TileId id_;
  std::vector<LiveVoxel> voxels_;
  BrickIndex positions_;
  tsl::robin_map<std::uint32_t, Excluded, IndexHash> excluded_;
  /// Positions of voxels in order of their keys; those added since the last publication are not
  /// in it yet.
  std::vector<std::uint32_t> sorted_;
  std::shared_ptr<const Tile> published_;
  /// Voxels that appeared, went or got another class since the last record.
  std::size_t unrecorded_voxels_ = 0;
  std::size_t recording_voxels_ = 0;
};

}  // namespace stillmap
