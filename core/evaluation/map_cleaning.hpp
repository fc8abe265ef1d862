#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "core/lidar/semantic_class.hpp"
#include "core/lidar/voxel_index.hpp"

namespace stillmap::evaluation {

/// What stands still and is thinner than a voxel: most rays pass beside it, and cleaning takes it
/// first.
inline constexpr std::array thin_classes{SemanticClass::fence, SemanticClass::trunk,
                                         SemanticClass::pole, SemanticClass::traffic_sign};

/// Ground truth of a map, from labelled scans at known poses: voxels with the number of moving,
/// parked and fixed points in each.
class MapTruth {
 public:
  explicit MapTruth(double voxel_size_m = 0.2);

  /// Adds points of the map frame [m] with their original SemanticKITTI ids; unlabeled (0) and
  /// outlier (1) points are left out. Throws std::invalid_argument when lengths differ.
  void add(std::span<const Eigen::Vector3f> points_map,
           std::span<const std::uint16_t> original_ids);

  struct Voxel {
    /// Mean of the points in it.
    Eigen::Vector3f mean_map = Eigen::Vector3f::Zero();
    std::uint32_t moving_points = 0;
    /// Points of vehicles and people that stand still.
    std::uint32_t parked_points = 0;
    std::uint32_t fixed_points = 0;
    /// Of the fixed ones, those of each of the thin classes.
    std::array<std::uint32_t, thin_classes.size()> thin_points{};
  };
  [[nodiscard]] std::vector<Voxel> voxels() const;
  [[nodiscard]] double voxel_size_m() const { return voxel_size_m_; }

 private:
  double voxel_size_m_;
  std::unordered_map<std::uint64_t, Voxel, IndexHash> voxels_;
};

/// Preservation and rejection rate of a cleaned map (H. Lim et al., ERASOR, RA-L 2021): a true
/// voxel is kept when a map point lies within half the voxel's diagonal of it.
struct MapCleaningScore {
  std::uint64_t fixed_voxels = 0, fixed_kept = 0;
  std::uint64_t parked_voxels = 0, parked_kept = 0;
  std::uint64_t moving_voxels = 0, moving_kept = 0;
  /// Of the fixed voxels, those most of whose points are of each thin class.
  std::array<std::uint64_t, thin_classes.size()> thin_voxels{}, thin_kept{};

  /// Share of fixed voxels that the map keeps. Parked vehicles do not count: the planning map
  /// leaves them out by design (paper II-C.2).
  [[nodiscard]] std::optional<double> preservation_rate() const;
  /// The same of the voxels of thin_classes[i].
  [[nodiscard]] std::optional<double> thin_preservation_rate(std::size_t i) const;
  /// As ERASOR counts: parked vehicles are static too.
  [[nodiscard]] std::optional<double> preservation_rate_with_parked() const;
  /// Share of moving voxels that are not in the map.
  [[nodiscard]] std::optional<double> rejection_rate() const;
  /// The same for parked vehicles.
  [[nodiscard]] std::optional<double> parked_rejection_rate() const;
  /// Harmonic mean of preservation and rejection rate.
  [[nodiscard]] std::optional<double> f1() const;
};

[[nodiscard]] MapCleaningScore map_cleaning_score(const MapTruth& truth,
                                                  std::span<const Eigen::Vector3f> points_map);

}  // namespace stillmap::evaluation
