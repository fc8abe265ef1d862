#pragma once

#include <array>
#include <map>
#include <set>

#include "core/occupancy/occupancy_map.hpp"
#include "tests/occupancy/random_scans.hpp"

namespace stillmap::test {

/// Brute-force reference of an occupancy map: a log-odds value for every voxel that was touched,
/// and every ray tested against every voxel of a box around the origin.
class DenseOccupancy {
 public:
  using Key = std::array<int, 3>;

  /// Voxels -`reach` .. `reach` - 1 along each axis.
  DenseOccupancy(const OccupancyConfig& config, int reach) : config_(config), reach_(reach) {}

  void insert(const PlacedScan& placed, const ScanUpdateOptions& use = {});

  [[nodiscard]] const std::map<Key, double>& log_odds() const { return log_odds_; }
  [[nodiscard]] Eigen::Vector3d centre_map(const Key& key) const;

 private:
  [[nodiscard]] Key key_of(const Eigen::Vector3d& p_map) const;
  /// The cube of 2 x 2 x 2 voxels.
  [[nodiscard]] Key octant_of(const Eigen::Vector3d& p_map) const;
  void add_passed(const Eigen::Vector3d& from_map, const Eigen::Vector3d& to_map,
                  std::set<Key>& passed) const;
  void change(const Key& key, double probability);

  OccupancyConfig config_;
  int reach_;
  std::uint64_t scans_ = 0;
  std::map<Key, double> log_odds_;
};

}  // namespace stillmap::test
