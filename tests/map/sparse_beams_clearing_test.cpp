#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "core/lidar/range_image_view.hpp"
#include "core/map/static_map.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using test::add_point;

constexpr double rad_per_degree = 0.017453292519943295;
constexpr double lidar_height_m = 1.9;

/// Range of what a ray from a lidar hits, in the frame of the map, without labels.
struct SparseWorld {
  /// A vehicle of two metres' width with its rear at this place ahead.
  std::optional<double> vehicle_at_m = {};
  /// Bars of a fence every three degrees, 10 m about the lidar, turned by this [degrees].
  std::optional<double> fence_turned_by = {};
  /// A rail of 8 cm across the way, 1 m above the ground.
  std::optional<double> rail_at_m = {};
  /// What labels are sure that the rail is.
  SemanticClass rail_label = SemanticClass::fence;

  [[nodiscard]] std::optional<double> rail_range_m(const Vector3d& origin,
                                                   const Vector3d& direction) const {
    if (!rail_at_m || direction.x() <= 0.0) return std::nullopt;
    const double range_m = (*rail_at_m - origin.x()) / direction.x();
    const Vector3d hit = origin + range_m * direction;
    const bool is_hit = std::abs(hit.z() + lidar_height_m - 1.0) < 0.04 && std::abs(hit.y()) < 3.0;
    return is_hit ? std::optional(range_m) : std::nullopt;
  }
  [[nodiscard]] double range_m(const Vector3d& origin, const Vector3d& direction,
                               double azimuth_degrees) const {
    double range_m = direction.z() < 0.0 ? -lidar_height_m / direction.z()
                                         : std::numeric_limits<double>::infinity();
    if (vehicle_at_m && direction.x() > 0.0) {
      const double at_m = (*vehicle_at_m - origin.x()) / direction.x();
      const Vector3d hit = origin + at_m * direction;
      const double above_ground_m = hit.z() + lidar_height_m;
      if (std::abs(hit.y()) < 1.0 && above_ground_m > 0.3 && above_ground_m < 1.6)
        range_m = std::min(range_m, at_m);
    }
    if (fence_turned_by) {
      const double off_bar = std::remainder(azimuth_degrees - *fence_turned_by, 3.0);
      range_m = std::min(range_m, std::abs(off_bar) < 0.1 ? 10.0 : 20.0);
    }
    return range_m;
  }
};

/// Clearing by the scans of a 16-beam lidar, whose beams are two degrees apart.
class SparseBeamsClearing : public testing::Test {
 protected:
  void see(const SparseWorld& world, double lidar_at_m, int scans = 1) {
    for (int i = 0; i < scans; ++i) {
      LabelledScan scan;
      scan.scan.stamp_ns = ++stamp_ns_;
      Isometry3d T_map_lidar = Isometry3d::Identity();
      T_map_lidar.translation().x() = lidar_at_m;
      for (int ring = 0; ring < 16; ++ring) {
        for (int shot = 0; shot < 1800; ++shot) {
          const double elevation = (2.0 * ring - 15.0) * rad_per_degree,
                       azimuth = 0.2 * shot - 180.0;
          const Vector3d direction(std::cos(elevation) * std::cos(azimuth * rad_per_degree),
                                   std::cos(elevation) * std::sin(azimuth * rad_per_degree),
                                   std::sin(elevation));
          const double range_m = world.range_m(T_map_lidar.translation(), direction, azimuth);
          if (range_m > 120.0) continue;
          if (const auto rail_m = world.rail_range_m(T_map_lidar.translation(), direction)) {
            add_point(scan, (*rail_m * direction).cast<float>(), world.rail_label);
            continue;
          }
          add_point(scan, (range_m * direction).cast<float>(), SemanticClass::unlabeled);
        }
      }
      std::vector<std::uint8_t> is_thin;
      RangeImageView view(scan.scan, vlp_16(), T_map_lidar, is_thin);
      map_.insert(scan, T_map_lidar, is_thin);
      if (++inserted_ % clearing_interval_ != 0) continue;
      map_.clear_seen_through(std::move(view), stamp_ns_);
    }
  }
  [[nodiscard]] std::vector<RemovedVoxel> removed() const {
    return map_.removed(test::everywhere(), map_.tiles_in(test::everywhere())).voxels;
  }
  [[nodiscard]] int shown_above(double height_m) {
    int count = 0;
    for (const auto& tile : map_.view()->tiles)
      count += static_cast<int>(std::ranges::count_if(tile->voxels, [height_m](const Voxel& voxel) {
        return voxel.mean_map.z() + lidar_height_m > height_m;
      }));
    return count;
  }

  /// Columns of voxels 0.2 m wide within 2 m to the sides in which the rail is shown.
  [[nodiscard]] std::size_t columns_of_rail_at(double at_m) {
    std::set<long> columns;
    for (const auto& tile : map_.view()->tiles)
      for (const Voxel& voxel : tile->voxels) {
        const Vector3d mean = voxel.mean_map.cast<double>();
        if (std::abs(mean.x() - at_m) < 0.2 && std::abs(mean.y()) < 2.0 &&
            std::abs(mean.z() + lidar_height_m - 1.0) < 0.1)
          columns.insert(std::lround(std::floor(mean.y() / 0.2)));
      }
    return columns.size();
  }

  [[nodiscard]] int shown(SemanticClass label) {
    int count = 0;
    for (const auto& tile : map_.view()->tiles)
      count += static_cast<int>(std::ranges::count_if(
          tile->voxels, [label](const Voxel& voxel) { return voxel.evidence.winner() == label; }));
    return count;
  }

  StaticMap map_{StaticMapConfig{}};
  std::int64_t stamp_ns_ = 0;
  int inserted_ = 0;
  int clearing_interval_ = 1;
};

TEST_F(SparseBeamsClearing, GroundBelowTheLowestBeamStays) {
  for (int step = 0; step < 60; ++step) see({}, 0.1 * step);
  EXPECT_TRUE(removed().empty());
}

TEST_F(SparseBeamsClearing, TheLowerPartOfAVehicleThatLeftGoes) {
  // The beam at -3 degrees hits it 0.75 m above the ground.
  see({.vehicle_at_m = 22.0}, 0.0, 2);
  ASSERT_GT(shown_above(0.6), 10);
  // From here that is between the beams at -3 and -5, which reach 22 m; the one below does not.
  see({}, 4.5);
  EXPECT_EQ(shown_above(0.6), 0);
}

TEST_F(SparseBeamsClearing, BarsBesideThoseThatAreHitNowStay) {
  see({.fence_turned_by = 0.0}, 0.0, 2);
  see({.fence_turned_by = 0.8}, 0.0, 4);
  EXPECT_TRUE(removed().empty());
}

TEST_F(SparseBeamsClearing, ARailBetweenBeamsMostOfTheTimeStays) {
  clearing_interval_ = 3;
  for (int step = 0; step < 90; ++step) see({.rail_at_m = 12.0}, 0.1 * step);
  int removed_of_it = 0;
  for (const RemovedVoxel& voxel : removed())
    removed_of_it += voxel.label == SemanticClass::fence ? 1 : 0;
  EXPECT_GT(shown(SemanticClass::fence), 50);
  EXPECT_LT(removed_of_it, 10);
  // Once it is gone, rays go through its place, too.
  for (int step = 0; step < 120; ++step) see({}, 0.1 * (step % 90));
  EXPECT_LT(shown(SemanticClass::fence), 5);
}

TEST_F(SparseBeamsClearing, ARailThatTheLidarDrivesTowardsStaysWithoutLabels) {
  constexpr SemanticClass none = SemanticClass::unlabeled;
  clearing_interval_ = 3;
  for (int step = 0; step < 20; ++step) see({.rail_at_m = 20.0, .rail_label = none}, 0.8 * step);
  EXPECT_GE(columns_of_rail_at(20.0), 18U);
  // Once it is gone, rays go through its place, too.
  for (int step = 0; step < 180; ++step) see({}, 0.1 * step);
  EXPECT_LE(columns_of_rail_at(20.0), 2U);
}

TEST_F(SparseBeamsClearing, AVehicleThatOneBeamAloneHitIsNoRail) {
  // The beam at -1 degree hits it 1.3 m above the ground; that at -3 passes through below it.
  see({.vehicle_at_m = 33.0}, 0.0, 2);
  ASSERT_GT(shown_above(0.6), 5);
  // From here its place is between these beams.
  see({}, 9.0);
  EXPECT_EQ(shown_above(0.6), 0);
}

}  // namespace
}  // namespace stillmap
