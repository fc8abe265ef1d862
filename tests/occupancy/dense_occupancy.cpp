#include "tests/occupancy/dense_occupancy.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap::test {
namespace {

double log_odds_of(double probability) { return std::log(probability / (1.0 - probability)); }

}  // namespace

DenseOccupancy::Key DenseOccupancy::key_of(const Eigen::Vector3d& p_map) const {
  const Eigen::Vector3i key = (p_map / config_.resolution_m).array().floor().cast<int>();
  return {key.x(), key.y(), key.z()};
}

DenseOccupancy::Key DenseOccupancy::octant_of(const Eigen::Vector3d& p_map) const {
  const Eigen::Vector3i key = (p_map / (2.0 * config_.resolution_m)).array().floor().cast<int>();
  return {key.x(), key.y(), key.z()};
}

Eigen::Vector3d DenseOccupancy::centre_map(const Key& key) const {
  return config_.resolution_m * Eigen::Vector3d(key[0] + 0.5, key[1] + 0.5, key[2] + 0.5);
}

void DenseOccupancy::add_passed(const Eigen::Vector3d& from_map, const Eigen::Vector3d& to_map,
                                std::set<Key>& passed) const {
  const Eigen::Vector3d way = to_map - from_map;
  const Eigen::Vector3d half = Eigen::Vector3d::Constant(config_.resolution_m / 2.0);
  for (int x = -reach_; x < reach_; ++x) {
    for (int y = -reach_; y < reach_; ++y) {
      for (int z = -reach_; z < reach_; ++z) {
        const Key key{x, y, z};
        const Eigen::Array3d low = (centre_map(key) - half - from_map).array() / way.array();
        const Eigen::Array3d high = (centre_map(key) + half - from_map).array() / way.array();
        const double enters = std::max(low.min(high).maxCoeff(), 0.0);
        const double leaves = std::min(low.max(high).minCoeff(), 1.0);
        if (enters < leaves) passed.insert(key);
      }
    }
  }
}

void DenseOccupancy::insert(const PlacedScan& placed, const ScanUpdateOptions& use) {
  const bool clears = scans_++ % config_.clearing_interval == 0 && use.clear_free_space;
  const Eigen::Vector3d lidar_map = placed.T_map_lidar.translation();
  std::set<Key> hits;
  std::set<Key> ends;
  std::set<Key> passed;
  for (std::size_t i = 0; i < placed.scan.scan.size(); ++i) {
    const Eigen::Vector3d p_lidar = placed.scan.scan.points_lidar[i].cast<double>();
    const Eigen::Vector3d p_map = placed.T_map_lidar * p_lidar;
    const double range_m = p_lidar.norm();
    if (placed.scan.motion[i] == Motion::stationary && range_m <= config_.max_range_m) {
      hits.insert(key_of(p_map));
    }
    const double cleared_m =
        std::min(range_m * (1.0 - config_.clearing_margin_share) - config_.clearing_margin_m,
                 config_.clearing_range_m);
    if (!clears || cleared_m <= 0.0) continue;
    const Eigen::Vector3d end_map = lidar_map + cleared_m / range_m * (p_map - lidar_map);
    if (ends.insert(octant_of(end_map)).second) add_passed(lidar_map, end_map, passed);
  }
  for (const Key& key : hits) change(key, config_.hit_probability);
  for (const Key& key : passed) {
    if (!hits.contains(key)) change(key, config_.miss_probability);
  }
}

void DenseOccupancy::change(const Key& key, double probability) {
  double& value = log_odds_[key];
  value =
      std::clamp(value + log_odds_of(probability), log_odds_of(OccupancyConfig::min_probability),
                 log_odds_of(OccupancyConfig::max_probability));
}

}  // namespace stillmap::test
