#include "core/evaluation/map_cleaning.hpp"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

namespace stillmap::evaluation {
namespace {

constexpr std::uint16_t outlier_id = 1;

using Cell = Eigen::Vector3i;

Cell cell_of(const Eigen::Vector3f& point, double cell_size_m) {
  return (point.cast<double>() / cell_size_m).array().floor().cast<int>();
}

std::uint64_t key(const Cell& cell) { return packed_index(cell.x(), cell.y(), cell.z()); }

// Radius search over map points, hashed into cells as large as the radius: all neighbours of a
// point lie in the 27 cells around it.
class RadiusSearch {
 public:
  RadiusSearch(std::span<const Eigen::Vector3f> points_map, double radius_m) : radius_m_(radius_m) {
    for (const Eigen::Vector3f& point : points_map) {
      if (point.allFinite()) cells_[key(cell_of(point, radius_m_))].push_back(point);
    }
  }

  [[nodiscard]] bool any_near(const Eigen::Vector3f& point) const {
    const Cell centre = cell_of(point, radius_m_);
    for (int i = 0; i < 27; ++i) {
      const Cell cell = centre + Cell(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1);
      if (holds_near(cell, point)) return true;
    }
    return false;
  }

 private:
  [[nodiscard]] bool holds_near(const Cell& cell, const Eigen::Vector3f& point) const {
    const auto found = cells_.find(key(cell));
    if (found == cells_.end()) return false;
    for (const Eigen::Vector3f& candidate : found->second) {
      if ((candidate - point).norm() <= static_cast<float>(radius_m_)) return true;
    }
    return false;
  }

  double radius_m_;
  std::unordered_map<std::uint64_t, std::vector<Eigen::Vector3f>, IndexHash> cells_;
};

std::optional<double> ratio(std::uint64_t part, std::uint64_t whole) {
  if (whole == 0) return std::nullopt;
  return static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

MapTruth::MapTruth(double voxel_size_m) : voxel_size_m_(voxel_size_m) {
  if (!(voxel_size_m > 0.0)) throw std::invalid_argument("voxel size must be greater than 0 m");
}

void MapTruth::add(std::span<const Eigen::Vector3f> points_map,
                   std::span<const std::uint16_t> original_ids) {
  if (points_map.size() != original_ids.size()) {
    throw std::invalid_argument(std::to_string(points_map.size()) + " points and " +
                                std::to_string(original_ids.size()) + " true labels");
  }
  for (std::size_t i = 0; i < points_map.size(); ++i) {
    if (original_ids[i] <= outlier_id || !points_map[i].allFinite()) continue;
    Voxel& voxel = voxels_[key(cell_of(points_map[i], voxel_size_m_))];
    const std::uint32_t before = voxel.moving_points + voxel.parked_points + voxel.fixed_points;
    voxel.mean_map += (points_map[i] - voxel.mean_map) / static_cast<float>(before + 1);
    const SemanticClass label = class_from_semantic_kitti(original_ids[i]);
    if (is_moving_semantic_kitti(original_ids[i])) {
      voxel.moving_points += 1;
    } else if (is_movable(label)) {
      voxel.parked_points += 1;
    } else {
      voxel.fixed_points += 1;
      for (std::size_t k = 0; k < thin_classes.size(); ++k)
        voxel.thin_points[k] += label == thin_classes[k] ? 1 : 0;
    }
  }
}

std::vector<MapTruth::Voxel> MapTruth::voxels() const {
  std::vector<Voxel> all;
  all.reserve(voxels_.size());
  for (const auto& [voxel_key, voxel] : voxels_) all.push_back(voxel);
  return all;
}

std::optional<double> MapCleaningScore::preservation_rate() const {
  return ratio(fixed_kept, fixed_voxels);
}

std::optional<double> MapCleaningScore::thin_preservation_rate(std::size_t i) const {
  return ratio(thin_kept.at(i), thin_voxels.at(i));
}

std::optional<double> MapCleaningScore::preservation_rate_with_parked() const {
  return ratio(fixed_kept + parked_kept, fixed_voxels + parked_voxels);
}

std::optional<double> MapCleaningScore::rejection_rate() const {
  return ratio(moving_voxels - moving_kept, moving_voxels);
}

std::optional<double> MapCleaningScore::parked_rejection_rate() const {
  return ratio(parked_voxels - parked_kept, parked_voxels);
}

std::optional<double> MapCleaningScore::f1() const {
  const auto preserved = preservation_rate(), rejected = rejection_rate();
  if (!preserved || !rejected || *preserved + *rejected == 0.0) return std::nullopt;
  return 2.0 * *preserved * *rejected / (*preserved + *rejected);
}

MapCleaningScore map_cleaning_score(const MapTruth& truth,
                                    std::span<const Eigen::Vector3f> points_map) {
  const RadiusSearch map_points(points_map, std::numbers::sqrt3 / 2.0 * truth.voxel_size_m());
  MapCleaningScore score;
  for (const MapTruth::Voxel& voxel : truth.voxels()) {
    const std::uint64_t kept = map_points.any_near(voxel.mean_map) ? 1 : 0;
    if (voxel.moving_points > voxel.parked_points + voxel.fixed_points) {
      score.moving_voxels += 1;
      score.moving_kept += kept;
    } else if (voxel.parked_points > voxel.fixed_points) {
      score.parked_voxels += 1;
      score.parked_kept += kept;
    } else {
      score.fixed_voxels += 1;
      score.fixed_kept += kept;
      for (std::size_t k = 0; k < thin_classes.size(); ++k) {
        if (2 * voxel.thin_points[k] <= voxel.fixed_points) continue;
        score.thin_voxels[k] += 1;
        score.thin_kept[k] += kept;
      }
    }
  }
  return score;
}

}  // namespace stillmap::evaluation
