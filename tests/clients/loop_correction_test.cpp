#include "clients/commands/mapping/loop_correction.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "core/dataset/dataset_error.hpp"
#include "tests/graph/street_world.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::cli {
namespace {

constexpr int scans = 60;
constexpr int begin = 20, end = 50;

/// What of a drive along a street, a metre a scan, is in a map of its scans between these two.
class StretchThatHasWaited : public testing::Test {
 protected:
  [[nodiscard]] MappedScan mapped(int k, MapEntry entry) const {
    const Eigen::Isometry3d T_map_lidar = world_.T_map_lidar_at(k, false);
    MappedScan mapped;
    mapped.odometry.T_map_lidar = T_map_lidar;
    mapped.odometry.map_entry = entry;
    mapped.labelled = world_.scan_at(T_map_lidar, static_cast<std::uint64_t>(k));
    mapped.labelled.scan.stamp_ns = 100'000'000 * (k + 1);
    return mapped;
  }
  /// `last` is the entry of the scan that ends the stretch.
  void drive(LoopCorrection& loops, int from, int to, MapEntry last) const {
    for (int k = from; k < to; ++k) {
      MapEntry entry = MapEntry::enters;
      if (k >= begin && k < end) entry = k == begin + 5 ? MapEntry::stays_out : MapEntry::waits;
      if (k == end) entry = last;
      loops.add(static_cast<std::size_t>(k), mapped(k, entry));
    }
  }
  /// Scans that saw something, by the times at which voxels were seen first and last.
  [[nodiscard]] std::size_t scans_in_map(LoopCorrection& loops) const {
    static_cast<void>(loops.finish());
    EXPECT_EQ(loops.T_map_lidar().size(), std::size_t{scans});
    StaticMap map({});
    EXPECT_TRUE(loops.insert_into(map, loops.T_map_lidar(), 0, [](std::size_t) { return true; }));
    std::set<std::int64_t> stamps;
    for (const auto& tile : map.view()->tiles)
      for (const Voxel& voxel : tile->voxels)
        stamps.insert({voxel.first_seen_ns, voxel.last_seen_ns});
    return stamps.size();
  }
  [[nodiscard]] LoopOptions options() const { return {scratch_ / "scans", 0.0, {}, {}}; }

 private:
  ScratchFolder scratch_;
  StreetWorld world_{11};
};

TEST_F(StretchThatHasWaited, IsInTheMapThatIsMadeAgain) {
  LoopCorrection loops(options(), vlp_16());
  drive(loops, 0, scans, MapEntry::enters_with_waiting);
  EXPECT_EQ(scans_in_map(loops), std::size_t{scans - 1});
}

TEST_F(StretchThatHasWaited, StaysOutWhereNobodyKnowsWhereItIs) {
  LoopCorrection loops(options(), vlp_16());
  drive(loops, 0, scans, MapEntry::enters);
  EXPECT_EQ(scans_in_map(loops), std::size_t{scans - (end - begin)});
}

TEST_F(StretchThatHasWaited, IsDecidedByScansAfterAnInterruption) {
  {
    LoopCorrection killed(options(), vlp_16());
    drive(killed, 0, begin + 15, MapEntry::enters);
    killed.flush();
  }
  LoopCorrection loops(options(), vlp_16());
  loops.resume(begin + 10, begin + 10);
  drive(loops, begin + 10, scans, MapEntry::enters_with_waiting);
  EXPECT_EQ(scans_in_map(loops), std::size_t{scans - 1});
}

// The power was lost before all scans were on disk: loops of the rest alone would be closed.
TEST_F(StretchThatHasWaited, AnInterruptedRunWhoseScansAreGoneIsRefused) {
  {
    LoopCorrection killed(options(), vlp_16());
    drive(killed, 0, begin, MapEntry::enters);
    killed.flush();
  }
  LoopCorrection loops(options(), vlp_16());
  try {
    loops.resume(begin + 10, begin + 10);
    FAIL() << "it has not all scans";
  } catch (const DatasetError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("--force"));
  }
}

TEST_F(StretchThatHasWaited, StaysOutAtTheEndOfTheDrive) {
  LoopCorrection loops(options(), vlp_16());
  drive(loops, 0, end, MapEntry::enters);
  EXPECT_FALSE(loops.finish());
  EXPECT_EQ(loops.T_map_lidar().size(), std::size_t{end});
}

/// A robot that goes 5 m/s along bends and stands for 4 s of every 12.
Eigen::Isometry3d T_odom_lidar_at(double time_s) {
  const double lap = std::floor(time_s / 12.0);
  const double moved_s = 8.0 * lap + std::min(8.0, time_s - 12.0 * lap);
  const double heading_rad = std::sin(0.4 * moved_s);
  return Eigen::Translation3d(5.0 * moved_s, 10.0 * std::sin(0.4 * moved_s), 0.0) *
         Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ());
}

std::int64_t stamp_ns_at(int k) { return 100'000'000 * (std::int64_t{k} + 1); }

MappedScan mapped_at(int k) {
  MappedScan mapped;
  mapped.odometry.T_map_lidar = T_odom_lidar_at(0.1 * k);
  mapped.odometry.map_entry = MapEntry::enters;
  for (int i = 0; i < 40; ++i)
    mapped.labelled.scan.points_lidar.emplace_back(static_cast<float>(i % 8), 5.0F,
                                                   0.2F * static_cast<float>(i / 8));
  mapped.labelled.motion.assign(mapped.labelled.scan.size(), Motion::stationary);
  mapped.labelled.scan.stamp_ns = stamp_ns_at(k);
  return mapped;
}

std::vector<GnssFix> fixes_of(int first_scan, int end, double delay_s) {
  const EastNorthUp earth(49.0, 8.4, 115.0);
  std::vector<GnssFix> fixes;
  for (int k = first_scan; k < end; k += 2) {
    GnssFix fix = earth.fix_at(T_odom_lidar_at(0.1 * k).translation());
    fix.stamp_ns = stamp_ns_at(k) + std::llround(1e9 * delay_s);
    fix.covariance_enu = Eigen::Vector3d::Constant(0.02 * 0.02).asDiagonal();
    fixes.push_back(fix);
  }
  return fixes;
}

// How late the stamps are may be known only at the end, when no submap is left to be closed.
TEST(LoopCorrectionOfLateStamps, KeepsThePositionsOfADriveThatEndsWithASubmap) {
  constexpr double delay_s = 0.4;
  constexpr int most_scans = 2000;
  // So that there are three stretches of 100 m, which tell a delay, between two looks at it.
  constexpr int first_fix = 60;
  const ScratchFolder scratch;
  LoopOptions options{scratch / "scans", 0.0, {}, {}};
  options.gnss.fixes = fixes_of(first_fix, most_scans, delay_s);
  LoopCorrection loops(options, vlp_16());
  double way_m = 0.0;
  bool is_submap_closed = false;
  int k = 0;
  for (; k < most_scans && (way_m < 345.0 || !is_submap_closed); ++k) {
    if (k > 0)
      way_m +=
          (T_odom_lidar_at(0.1 * k).translation() - T_odom_lidar_at(0.1 * (k - 1)).translation())
              .norm();
    const std::size_t submaps = loops.report().submaps;
    loops.add(static_cast<std::size_t>(k), mapped_at(k));
    is_submap_closed = loops.report().submaps > submaps;
  }
  ASSERT_LT(way_m, 380.0);
  ASSERT_EQ(loops.report().gnss.value().delay.delay_s, 0.0) << "not known before the end";
  EXPECT_TRUE(loops.finish());
  const GnssReport gnss = loops.report().gnss.value();
  EXPECT_NEAR(gnss.delay.delay_s, delay_s, 0.05);
  EXPECT_GT(gnss.positions.used, 20U);
  EXPECT_TRUE(gnss.datum);
}

// Of a part of a drive, as of the first scans of many: the rest went on in another country.
TEST(LoopCorrectionOfAPart, LeavesOutFixesOfTheRest) {
  constexpr int begin_scan = 2000, end_scan = 2200;
  const ScratchFolder scratch;
  LoopOptions options{scratch / "scans", 0.0, {}, {}};
  options.gnss.fixes = fixes_of(begin_scan, end_scan, 0.0);
  for (GnssFix fix : fixes_of(0, 1000, 0.0)) {
    fix.latitude_deg = 10.0;
    options.gnss.fixes.push_back(fix);
    fix.latitude_deg = 20.0;
    fix.stamp_ns += stamp_ns_at(end_scan + 500);
    options.gnss.fixes.push_back(fix);
  }
  LoopCorrection loops(options, vlp_16());
  for (int k = begin_scan; k < end_scan; ++k) loops.add(static_cast<std::size_t>(k), mapped_at(k));
  EXPECT_TRUE(loops.finish());
  const GnssReport gnss = loops.report().gnss.value();
  EXPECT_GT(gnss.positions.used, 5U);
  ASSERT_TRUE(gnss.datum);
  EXPECT_NEAR(gnss.datum->latitude_deg, 49.0, 0.1);
}

}  // namespace
}  // namespace stillmap::cli
