#include "core/lendable_map.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <memory>
#include <string>
#include <utility>

namespace stillmap {
namespace {

constexpr double degree = 0.017453292519943295;

/// Rays of a 64-beam lidar ahead, which hit a wall so far away, or something before it.
LabelledScan looking_ahead(std::int64_t stamp_ns, double wall_m, bool is_something_there) {
  LabelledScan scan;
  scan.scan.stamp_ns = stamp_ns;
  for (int ring = 0; ring < 30; ++ring) {
    for (int column = 0; column < 100; ++column) {
      const double elevation = (-10.0 + 0.4 * ring) * degree;
      const double azimuth = (-10.0 + 0.2 * column) * degree;
      const bool is_before_wall = is_something_there && std::abs(azimuth) < 6.0 * degree;
      const double range_m = is_before_wall ? 10.0 : wall_m;
      scan.scan.points_lidar.push_back(
          (range_m * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                     std::cos(elevation) * std::sin(azimuth), std::sin(elevation)))
              .cast<float>());
    }
  }
  scan.motion.assign(scan.scan.size(), Motion::stationary);
  return scan;
}

struct Voxels {
  std::size_t all = 0;
  /// Of what is before the wall.
  std::size_t before_wall = 0;

  friend bool operator==(const Voxels&, const Voxels&) = default;
};

Voxels voxels_of(LendableMap& map) {
  Voxels voxels;
  for (const auto& tile : map.map().view()->tiles) {
    voxels.all += tile->voxels.size();
    for (const auto voxel : tile->voxels)
      voxels.before_wall += voxel.mean_map.x() < 12.0F ? 1U : 0U;
  }
  return voxels;
}

struct Seen {
  Voxels before;
  Voxels after;
};

/// What a map has of something before and after the last scans, which come in late and see the
/// wall behind it: before that another lidar was told, or not.
Seen seen(bool is_other_told, bool wait) {
  LendableMap map({}, hdl_64e());
  std::int64_t stamp_ns = 0;
  const auto at_origin = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 30; ++i) map.insert(looking_ahead(++stamp_ns, 20.0, true), at_origin);
  const Voxels before = voxels_of(map);
  static_cast<void>(map.lend());
  for (int i = 0; i < 60; ++i) {
    if (wait) {
      // Those that wait must be some way apart.
      const double back_m = 0.5 * i;
      Eigen::Isometry3d T_map_lidar = at_origin;
      T_map_lidar.translation().x() = -back_m;
      map.let_wait(looking_ahead(++stamp_ns, 20.0 + back_m, false), T_map_lidar);
    } else {
      map.insert(looking_ahead(++stamp_ns, 20.0, false), at_origin);
    }
  }
  // One that looks steeply down.
  SensorModel other = hdl_64e();
  other.fov_up = -40.0 * degree;
  other.fov_down = -65.0 * degree;
  if (is_other_told) map.use_sensor(other);
  map.reclaim();
  map.insert_kept();
  static_cast<void>(map.decide_waiting(MapEntry::enters_with_waiting, false));
  return {before, voxels_of(map)};
}

TEST(LendableMap, ScansThatAreKeptAreOfTheLidarThatTookThem) {
  for (const bool wait : {false, true}) {
    const Seen told = seen(true, wait);
    EXPECT_GT(told.before.before_wall, 100U);
    EXPECT_LT(told.after.before_wall, told.before.before_wall / 2) << "they saw through it";
    EXPECT_EQ(told.after, seen(false, wait).after);
  }
}

TEST(LendableMap, ScansThatWaitedEnterLaterWhereThatIsSaidOrTheMapIsLent) {
  for (const auto& [later, is_lent] : {std::pair{false, false}, {true, false}, {false, true}}) {
    SCOPED_TRACE(std::string(later ? "later" : "now") + (is_lent ? ", lent" : ""));
    LendableMap map({}, hdl_64e());
    map.let_wait(looking_ahead(1, 20.0, false), Eigen::Isometry3d::Identity());
    if (is_lent) static_cast<void>(map.lend());
    EXPECT_EQ(map.decide_waiting(MapEntry::enters_with_waiting, later), 1U);
    EXPECT_EQ(map.confirmed_scans(), later || is_lent ? 1U : 0U);
    if (is_lent) map.reclaim();
    EXPECT_EQ(voxels_of(map).all > 0, !later && !is_lent);
    map.insert_confirmed();
    EXPECT_EQ(map.confirmed_scans(), 0U);
    EXPECT_GT(voxels_of(map).all, 100U);
  }
}

}  // namespace
}  // namespace stillmap
