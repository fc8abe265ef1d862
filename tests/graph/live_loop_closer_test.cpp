#include "core/graph/live_loop_closer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "core/geodesy/east_north_up.hpp"
#include "tests/graph/street_world.hpp"

namespace stillmap {
namespace {

/// A drive round the street, whose odometry turns and sinks by a little too much every metre; and a
/// map of poses that carries out what it is told.
class LiveDrive {
 public:
  explicit LiveDrive(std::uint64_t seed, const LiveLoopConfig& config = {})
      : world_(seed), closer_(config) {}
  /// In a map of the street's first 60 m, whose last scan was taken then.
  LiveDrive(std::uint64_t seed, std::int64_t seen_until_ns)
      : world_(seed), closer_({}, EarlierMap(world_.earlier_map(-30.0, 60.0, 7)), seen_until_ns) {}

  void go(double ways_m) {
    Eigen::Isometry3d T_drift = Eigen::Isometry3d::Identity();
    T_drift.translate(Eigen::Vector3d(0, 0, 0.003));
    T_drift.rotate(Eigen::AngleAxisd(0.0001, Eigen::Vector3d::UnitZ()));
    for (; way_m_ < ways_m; way_m_ += 1.0) {
      const Eigen::Isometry3d T = T_map_first_.inverse() * world_.T_map_lidar_at(way_m_, false);
      if (!truth.empty()) T_odom_lidar_ = T_odom_lidar_ * truth.back().inverse() * T * T_drift;
      truth.push_back(T);
      add(T);
    }
  }

  void add(const Eigen::Isometry3d& T_truth) {
    LabelledScan scan = world_.scan_at(T_map_first_ * T_truth, 100 + in_map.size());
    scan.scan.stamp_ns = stamp_ns(in_map.size()) + clock_offset_ns;
    // As a mapper does.
    in_map.push_back(T_map_odom * T_odom_lidar_);
    if (receiver) {
      GnssFix fix = receiver(T_truth);
      fix.stamp_ns = scan.scan.stamp_ns;
      EXPECT_EQ(closer_.add(fix), "");
    }
    const auto correction = closer_.add(scan, T_odom_lidar_, true);
    if (!correction) return;
    ++corrections;
    for (std::size_t i = 0; i < in_map.size(); ++i) {
      const auto* const T_new_old = correction->at(stamp_ns(i));
      ASSERT_NE(T_new_old, nullptr);
      // What moves by less would not be moved in the map, and never be made up for.
      EXPECT_TRUE(T_new_old->isApprox(Eigen::Isometry3d::Identity(), 0.0) ||
                  MapCorrection::max_shift_m(correction->poses()[i], LiveLoopConfig().range_m) >=
                      LiveLoopConfig().min_shift_m);
      EXPECT_TRUE(correction->poses()[i].position_map.isApprox(in_map[i].translation(), 1e-9) ||
                  in_map[i].translation().norm() < 1e-6);
      in_map[i] = *T_new_old * in_map[i];
    }
    T_map_odom = correction->latest() * T_map_odom;
  }

  [[nodiscard]] double rmse_m() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i)
      sum += (in_map[i].translation() - truth[i].translation()).squaredNorm();
    return std::sqrt(sum / static_cast<double>(truth.size()));
  }
  [[nodiscard]] const LiveLoopCloser& closer() const { return closer_; }

  std::vector<Eigen::Isometry3d> truth;
  std::vector<Eigen::Isometry3d> in_map;
  Eigen::Isometry3d T_map_odom = Eigen::Isometry3d::Identity();
  std::int64_t clock_offset_ns = 0;
  int corrections = 0;
  /// What a receiver with its antenna in the lidar says; none where there is none.
  std::function<GnssFix(const Eigen::Isometry3d& T_truth)> receiver;

 private:
  static std::int64_t stamp_ns(std::size_t i) {
    return 1'000'000'000 + static_cast<std::int64_t>(i) * 100'000'000;
  }

  StreetWorld world_;
  LiveLoopCloser closer_;
  Eigen::Isometry3d T_map_first_ = world_.T_map_lidar_at(0.0, false);
  Eigen::Isometry3d T_odom_lidar_ = Eigen::Isometry3d::Identity();
  double way_m_ = 0.0;
};

TEST(LiveLoopCloser, TheMapIsMovedAsSoonAsAPlaceIsSeenAgain) {
  LiveDrive drive(11);
  drive.go(0.95 * StreetWorld::length_m);
  EXPECT_EQ(drive.corrections, 0);
  const double open_m = drive.rmse_m();
  drive.go(1.5 * StreetWorld::length_m);
  EXPECT_GE(drive.corrections, 1);
  EXPECT_GE(drive.closer().closures().size(), 3U);
  EXPECT_LT(drive.rmse_m(), 0.6 * open_m);
  // What follows is where it belongs, too.
  EXPECT_LT((drive.in_map.back().translation() - drive.truth.back().translation()).norm(), 0.5);
}

TEST(LiveLoopCloser, WhatIsSeenFromNowOnIsMovedToFitTheMapThatWasThere) {
  LiveDrive drive(11, 999'999'999);
  drive.go(0.95 * StreetWorld::length_m);
  const int corrections_in_map = drive.corrections;
  EXPECT_GT((drive.in_map.back().translation() - drive.truth.back().translation()).norm(), 0.6)
      << "outside nothing tells";
  drive.go(1.2 * StreetWorld::length_m);
  EXPECT_GT(drive.corrections, corrections_in_map);
  EXPECT_TRUE(drive.closer().closures().empty());
  EXPECT_LT((drive.in_map.back().translation() - drive.truth.back().translation()).norm(), 0.3);
  EXPECT_LT((drive.in_map[20].translation() - drive.truth[20].translation()).norm(), 0.1);
}

TEST(LiveLoopCloser, ScansOfTheTimeOfTheMapThatWasThereLeaveLoopsOpen) {
  LiveDrive drive(11, 1'000'000'000);
  drive.go(1.2 * StreetWorld::length_m);
  EXPECT_EQ(drive.corrections, 0);
  EXPECT_THAT(drive.closer().end_reason(), testing::HasSubstr("set back"));
}

TEST(LiveLoopCloser, SubmapsLieWhereTheMapHasThem) {
  LiveDrive drive(11);
  EXPECT_TRUE(drive.closer().submaps().submaps.empty());
  std::size_t joined = 0;
  for (double way_m = 60.0; way_m < 1.4 * StreetWorld::length_m; way_m += 20.0) {
    drive.go(way_m);
    const SubmapList list = drive.closer().submaps();
    ASSERT_EQ(list.submaps.size(), drive.closer().submap_count());
    EXPECT_EQ(list.graph_revision, static_cast<std::uint64_t>(drive.corrections));
    EXPECT_EQ(list.loops.size(), drive.closer().closures().size());
    double last_m = -1.0;
    for (const SubmapList::Entry& submap : list.submaps) {
      const auto scan = static_cast<std::size_t>((submap.stamp_ns - 1'000'000'000) / 100'000'000);
      EXPECT_TRUE(submap.T_map_submap.isApprox(drive.in_map.at(scan), 1e-9));
      EXPECT_GT(submap.way_m, last_m);
      last_m = submap.way_m;
    }
    for (const SubmapList::Loop& loop : list.loops) {
      ASSERT_LT(loop.from, loop.to);
      ASSERT_LT(loop.to, list.submaps.size());
      const Eigen::Isometry3d T_from_to =
          list.submaps[loop.from].T_map_submap.inverse() * list.submaps[loop.to].T_map_submap;
      EXPECT_LT((T_from_to.translation() - loop.T_from_to.translation()).norm(), 0.5);
    }
    joined += list.loops.size();
  }
  EXPECT_GT(drive.corrections, 0);
  EXPECT_GT(joined, 0U);
}

TEST(LiveLoopCloser, SmallCorrectionsWaitForOneAnother) {
  LiveLoopConfig patient;
  patient.min_shift_m = 100.0;
  LiveDrive drive(11, patient);
  drive.go(1.4 * StreetWorld::length_m);
  EXPECT_FALSE(drive.closer().closures().empty());
  EXPECT_EQ(drive.corrections, 0);
  EXPECT_TRUE(drive.T_map_odom.isApprox(Eigen::Isometry3d::Identity()));
}

TEST(LiveLoopCloser, AClockThatIsSetBackLeavesLoopsOpen) {
  LiveDrive drive(11);
  drive.go(0.5 * StreetWorld::length_m);
  drive.clock_offset_ns = -10'000'000'000;
  drive.go(1.5 * StreetWorld::length_m);
  EXPECT_EQ(drive.corrections, 0);
  EXPECT_THAT(drive.closer().end_reason(), testing::HasSubstr("set back"));
  EXPECT_EQ(drive.closer().submaps().submaps.size(), drive.closer().submap_count());
  EXPECT_GT(drive.closer().submap_count(), 0U) << "those of before";
}

TEST(LiveLoopCloser, ARobotThatStandsAddsNothing) {
  LiveDrive drive(11);
  drive.go(60.0);
  const std::size_t looked_at = drive.closer().scans_looked_at();
  EXPECT_EQ(looked_at, 60U);
  for (int i = 0; i < 100; ++i) drive.add(drive.truth.back());
  EXPECT_EQ(drive.closer().scans_looked_at(), looked_at);
}

TEST(LiveLoopCloser, MemoryIsBounded) {
  LiveLoopConfig small;
  small.max_submap_bytes = 1'000'000;
  LiveDrive drive(11, small);
  drive.go(0.6 * StreetWorld::length_m);
  EXPECT_THAT(drive.closer().end_reason(), testing::HasSubstr("limit"));
  EXPECT_EQ(drive.closer().submap_bytes(), 0U);
  EXPECT_GT(drive.closer().submaps().submaps.size(), 0U) << "clients keep the places";
  drive.go(1.5 * StreetWorld::length_m);
  EXPECT_EQ(drive.closer().submap_bytes(), 0U);
  EXPECT_EQ(drive.corrections, 0);
}

TEST(LiveLoopCloser, AFirstFixOfAnotherPlaceDoesNotSayWhereTheMapLies) {
  const EastNorthUp earth(49.0, 8.4, 115.0);
  LiveDrive drive(12);
  bool is_first = true;
  drive.receiver = [&](const Eigen::Isometry3d& T_truth) {
    GnssFix fix = earth.fix_at(T_truth.translation());
    fix.covariance_enu = 0.0025 * Eigen::Matrix3d::Identity();
    if (std::exchange(is_first, false)) {
      fix.latitude_deg = 0.001;
      fix.longitude_deg = 0.0;
    }
    return fix;
  };
  drive.go(0.4 * StreetWorld::length_m);
  const auto place = drive.closer().on_earth();
  ASSERT_TRUE(place);
  EXPECT_NEAR(place->datum.latitude_deg, 49.0, 1e-5);
  EXPECT_NEAR(place->datum.longitude_deg, 8.4, 1e-5);
  EXPECT_NEAR(place->datum.x_axis_azimuth_deg, 90.0, 0.5);
  const Eigen::Isometry3d T_error =
      earth.T_earth(Eigen::Isometry3d::Identity()).inverse() * place->T_earth_map;
  EXPECT_LT(Eigen::AngleAxisd(T_error.linear()).angle(), 0.02);
}

TEST(LiveLoopCloser, StampsThatAreLateMoveTheMapUntilThatIsFoundOut) {
  const EastNorthUp earth(49.0, 8.4, 115.0);
  LiveLoopCloser closer{LiveLoopConfig{}};
  std::vector<Eigen::Isometry3d> truth, in_map;
  Eigen::Isometry3d T_truth = Eigen::Isometry3d::Identity();
  constexpr std::size_t late_scans = 4;
  for (std::size_t i = 0; i < 600; ++i) {
    const double turn_rad = 0.04 * std::cos(static_cast<double>(i) / 15.0);
    truth.push_back(T_truth);
    T_truth = T_truth * Eigen::Translation3d(1.0, 0.0, 0.0) *
              Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ());
    LabelledScan scan;
    scan.scan.stamp_ns = static_cast<std::int64_t>(i + 1) * 100'000'000;
    GnssFix fix = earth.fix_at(truth[i - std::min(i, late_scans)].translation());
    fix.stamp_ns = scan.scan.stamp_ns;
    fix.covariance_enu = 0.0004 * Eigen::Matrix3d::Identity();
    EXPECT_EQ(closer.add(fix), "");
    in_map.push_back(truth[i]);
    if (i > 0) in_map[i] = in_map[i - 1] * truth[i - 1].inverse() * truth[i];
    const auto correction = closer.add(scan, truth[i], true);
    if (!correction) continue;
    for (std::size_t k = 0; k <= i; ++k) in_map[k] = correction->poses()[k].T_new_old * in_map[k];
  }
  EXPECT_NEAR(closer.gnss().delay().delay_s, 0.4, 0.01);
  EXPECT_FALSE(closer.are_positions_refused());
  ASSERT_TRUE(closer.on_earth());
  double worst_m = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i)
    worst_m = std::max(worst_m, (in_map[i].translation() - truth[i].translation()).norm());
  EXPECT_LT(worst_m, 0.2);
}

}  // namespace
}  // namespace stillmap
