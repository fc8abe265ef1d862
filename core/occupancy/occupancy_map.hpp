#pragma once

#include <limits>
#include <memory>

#include "core/lidar/labelled_scan.hpp"
#include "core/map/throttle_callback.hpp"
#include "core/map/tile.hpp"
#include "core/occupancy/occupancy_config.hpp"
#include "core/occupancy/occupancy_query.hpp"
#include "core/occupancy/octomap_data.hpp"

namespace stillmap {

/// Size of a map.
struct OccupancySize {
  std::uint64_t nodes = 0;
  std::uint64_t memory_bytes = 0;
};

/// Occupied, free and unknown space of the static world, as an OctoMap (Hornung et al., 2013). NOT
/// thread-safe: readers on other threads need a lock against the writer.
class OccupancyMap {
 public:
  /// Throws std::invalid_argument with `config.faults()`.
  explicit OccupancyMap(const OccupancyConfig& config);
  /// Decodes a map that any OctoMap program encoded. Voxels of binary data get the clamping
  /// probabilities. Throws std::invalid_argument for damaged data.
  explicit OccupancyMap(const OctomapData& data);
  ~OccupancyMap();
  OccupancyMap(OccupancyMap&&) noexcept;
  OccupancyMap& operator=(OccupancyMap&&) noexcept;

  /// Voxels of stationary points are updated as hits; if the scan clears, voxels that the rays of
  /// all its points traverse are updated as misses. Each voxel is updated once a scan, and hits
  /// take precedence. @pre scan.motion.size() == scan.scan.size()
  void insert(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
              const ScanUpdateOptions& use = {});

  /// The two halves of insert(). compute_update() takes longer and changes nothing that readers
  /// see, so it needs no lock against them. apply_update() changes the octree by at most
  /// `max_bricks` and returns whether more are left; between calls, readers may have the lock.
  /// Nothing else may be inserted before all are applied.
  void compute_update(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
                      const ScanUpdateOptions& use, const ThrottleCallback& throttle = {});
  bool apply_update(std::size_t max_bricks = std::numeric_limits<std::size_t>::max());
  /// Bricks that apply_update() applies in about a millisecond.
  static constexpr std::size_t portion_bricks = 512;

  /// Sets the voxels of a static map to the highest occupancy probability. Returns how many are
  /// left out, since the octree ends before them: it reaches `reach_m()` along each axis.
  std::size_t insert(const MapSnapshot& view, const ThrottleCallback& throttle = {});
  [[nodiscard]] double reach_m() const;

  /// The octree has the voxels of this view, whose residency is followed from here on.
  void begin_residency(const MapSnapshot& view);
  /// Follows the residency of the static map's tiles, at the cost of what changed: columns whose
  /// tiles have all been evicted to the tile store become unknown; reloaded tiles are inserted as
  /// occupied (their free space has to be observed again). Returns whether anything changed.
  bool sync_residency(const MapSnapshot& view);

  [[nodiscard]] PointOccupancy at_point(const Eigen::Vector3d& p_map) const;
  /// At most `max_voxels` occupied voxels are listed; all are counted.
  [[nodiscard]] BoxOccupancy in_box(const Eigen::AlignedBox3d& box_map,
                                    std::size_t max_voxels) const;
  [[nodiscard]] RayOccupancy along_ray(const RayQuery& ray) const;

  /// Throws std::invalid_argument with `query.faults()`. `pause` is called about every millisecond,
  /// and a writer may have the octree meanwhile: what comes later in the answer is then of the
  /// changed octree.
  [[nodiscard]] OccupancyAnswers answer(const OccupancyQuery& query,
                                        const ThrottleCallback& pause = {}) const;

  /// In OctoMap's encoding; binary data is pruned. `pause` as above.
  [[nodiscard]] OctomapData encode(OctomapEncoding encoding,
                                   const ThrottleCallback& pause = {}) const;

  /// Incremented by every insertion.
  [[nodiscard]] std::uint64_t version() const;
  [[nodiscard]] double resolution_m() const;
  [[nodiscard]] OccupancySize size() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
