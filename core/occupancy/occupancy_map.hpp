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

/// What a map holds and weighs.
struct OccupancySize {
  std::uint64_t nodes = 0;
  std::uint64_t memory_bytes = 0;
};

/// Occupied, free and unknown space of the still world, as an OctoMap (Hornung et al., 2013). One
/// thread writes; reading from others at the same time needs a lock.
class OccupancyMap {
 public:
  /// Throws std::invalid_argument with `config.faults()`.
  explicit OccupancyMap(const OccupancyConfig& config);
  /// A map that was encoded before, by any OctoMap program. It says nothing about how sure a voxel
  /// of binary data is, so those are as sure as can be. Throws std::invalid_argument for damaged
  /// data.
  explicit OccupancyMap(const OctomapData& data);
  ~OccupancyMap();
  OccupancyMap(OccupancyMap&&) noexcept;
  OccupancyMap& operator=(OccupancyMap&&) noexcept;

  /// Stationary points become occupied voxels; where the scan is one of those that clear, what the
  /// rays of all its points pass becomes free. A voxel changes once a scan, and a hit counts before
  /// what passed. `scan.motion` is as long as the scan.
  void insert(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
              const ScanUpdateOptions& use = {});

  /// The two halves of it: the first, which takes longer and may be held up, changes nothing that
  /// readers see, and needs no lock against them. The second can be done in portions, with readers
  /// between them; it returns whether more is left. Nothing else may be inserted before that.
  void compute_update(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar,
                      const ScanUpdateOptions& use, const ThrottleCallback& throttle = {});
  bool apply_update(std::size_t max_bricks = std::numeric_limits<std::size_t>::max());
  /// A portion that takes about a millisecond.
  static constexpr std::size_t portion_bricks = 512;

  /// Takes the voxels of a static map for occupied, as sure as can be.
  void insert(const MapSnapshot& view, const ThrottleCallback& throttle = {});

  /// Where the static map's tiles are in the tile store, nothing stays in memory here either; where
  /// they came back, their voxels are occupied again, and free space is to be seen anew. Returns
  /// whether that changed anything.
  bool sync_residency(const MapSnapshot& view);

  [[nodiscard]] PointOccupancy at_point(const Eigen::Vector3d& p_map) const;
  /// At most `max_voxels` occupied voxels are listed; all are counted.
  [[nodiscard]] BoxOccupancy in_box(const Eigen::AlignedBox3d& box_map,
                                    std::size_t max_voxels) const;
  [[nodiscard]] RayOccupancy along_ray(const RayQuery& ray) const;

  /// Throws std::invalid_argument with `query.faults()`.
  [[nodiscard]] OccupancyAnswers answer(const OccupancyQuery& query) const;

  /// As OctoMap encodes it; binary data is pruned to the fewest nodes.
  [[nodiscard]] OctomapData encode(bool binary) const;

  /// Grows with every insertion.
  [[nodiscard]] std::uint64_t version() const;
  [[nodiscard]] double resolution_m() const;
  [[nodiscard]] OccupancySize size() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
