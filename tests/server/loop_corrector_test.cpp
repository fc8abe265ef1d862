#include "server/mapping/loop_corrector.hpp"

#include <gtest/gtest.h>

#include "tests/eventually.hpp"
#include "tests/graph/street_world.hpp"

namespace stillmap::server {
namespace {

/// A round of a street and a quarter, whose odometry turns and sinks by a little too much.
class Round {
 public:
  explicit Round(LoopCorrector& loops) : loops_(loops) {}

  void go(double ways_m) {
    Eigen::Isometry3d T_drift = Eigen::Isometry3d::Identity();
    T_drift.translate(Eigen::Vector3d(0, 0, 0.003));
    T_drift.rotate(Eigen::AngleAxisd(0.0001, Eigen::Vector3d::UnitZ()));
    for (; way_m_ < ways_m; way_m_ += 1.0) {
      const Eigen::Isometry3d T_map_lidar = world_.T_map_lidar_at(way_m_, false);
      if (T_last_) T_odom_lidar_ = T_odom_lidar_ * T_last_->inverse() * T_map_lidar * T_drift;
      T_last_ = T_map_lidar;
      auto scan = std::make_shared<LabelledScan>(
          world_.scan_at(T_map_lidar, static_cast<std::uint64_t>(way_m_)));
      scan->scan.stamp_ns = static_cast<std::int64_t>(1e8 * (10.0 + way_m_));
      loops_.add(scan, T_odom_lidar_, Eigen::Isometry3d::Identity(), true);
      if (!takes) continue;
      if (auto correction = loops_.take()) corrections.push_back(*std::move(correction));
    }
    ASSERT_TRUE(test::eventually([&] { return loops_.waiting() == 0; }));
  }

  bool takes = true;
  std::vector<MapCorrection> corrections;

 private:
  LoopCorrector& loops_;
  StreetWorld world_{11};
  double way_m_ = 0.0;
  std::optional<Eigen::Isometry3d> T_last_;
  Eigen::Isometry3d T_odom_lidar_ = Eigen::Isometry3d::Identity();
};

std::uint64_t closed(const Statistics& statistics) {
  dds::ServerStatus status;
  statistics.report_to(status);
  return status.counter("loops_closed");
}

TEST(LoopCorrector, SaysBesideTheDriveWhatIsToBeMoved) {
  Statistics statistics;
  LoopCorrector loops({}, true, statistics);
  loops.begin_map(true);
  Round round(loops);
  round.go(1.25 * StreetWorld::length_m);
  ASSERT_TRUE(test::eventually([&] {
    if (auto correction = loops.take()) round.corrections.push_back(*std::move(correction));
    return !round.corrections.empty();
  }));
  EXPECT_GT(closed(statistics), 0U);
  EXPECT_GT(round.corrections.front().latest().translation().norm(), 0.1);
}

TEST(LoopCorrector, TellsSubmapsOnlyAsTheMapHasThem) {
  Statistics statistics;
  LoopCorrector loops({}, true, statistics);
  loops.begin_map(true);
  Round round(loops);
  round.takes = false;
  round.go(0.5 * StreetWorld::length_m);
  std::optional<SubmapList> list;
  ASSERT_TRUE(test::eventually([&] { return (list = loops.take_submaps()).has_value(); }));
  EXPECT_GE(list->submaps.size(), 2U);
  EXPECT_EQ(list->graph_revision, 0U);
  EXPECT_FALSE(loops.take_submaps()) << "nothing changed";

  round.go(1.25 * StreetWorld::length_m);
  std::optional<MapCorrection> correction;
  ASSERT_TRUE(test::eventually([&] { return (correction = loops.take()).has_value(); }));
  EXPECT_FALSE(loops.take_submaps()) << "the map is not moved yet";
  loops.report(*correction, {}, 1.0);
  list = loops.take_submaps();
  ASSERT_TRUE(list);
  EXPECT_GT(list->graph_revision, 0U);
  EXPECT_FALSE(list->loops.empty());

  loops.begin_map(true);
  EXPECT_FALSE(loops.take_submaps()) << "of the map before";
}

TEST(LoopCorrector, SaysNothingOfAMapThatWasLoadedOrIsNoMore) {
  Statistics statistics;
  LoopCorrector loops({}, true, statistics);
  loops.begin_map(false);
  Round loaded(loops);
  loaded.go(1.25 * StreetWorld::length_m);
  EXPECT_TRUE(loaded.corrections.empty());
  EXPECT_EQ(closed(statistics), 0U);
  loops.begin_map(true);
  Round round(loops);
  round.takes = false;
  round.go(1.25 * StreetWorld::length_m);
  ASSERT_TRUE(test::eventually([&] { return closed(statistics) > 0; }));
  loops.begin_map(true);
  EXPECT_FALSE(loops.take());
}

TEST(LoopCorrector, MovesNothingByTimesThatCameTwice) {
  Statistics statistics;
  LoopCorrector loops({}, true, statistics);
  loops.begin_map(true);
  Round round(loops);
  round.takes = false;
  round.go(1.25 * StreetWorld::length_m);
  ASSERT_TRUE(test::eventually([&] { return closed(statistics) > 0; }));
  auto again = std::make_shared<LabelledScan>();
  again->scan.stamp_ns = 1;
  loops.add(again, Eigen::Isometry3d::Identity(), Eigen::Isometry3d::Identity(), true);
  ASSERT_TRUE(test::eventually([&] { return loops.waiting() == 0; }));
  EXPECT_FALSE(loops.take());
}

TEST(LoopCorrector, LeavesOutScansOfALiveSensorThatItCannotLookAt) {
  Statistics statistics;
  LoopCorrector loops({}, false, statistics);
  loops.begin_map(true);
  const StreetWorld world(11);
  for (int k = 0; k < 200; ++k) {
    auto scan = std::make_shared<LabelledScan>();
    if (k % 100 == 0) *scan = world.scan_at(world.T_map_lidar_at(k, false), 1);
    scan->scan.stamp_ns = 1 + k;
    loops.add(scan, Eigen::Isometry3d(Eigen::Translation3d(k, 0, 0)), Eigen::Isometry3d::Identity(),
              true);
    EXPECT_LE(loops.waiting(), 20U);
  }
  ASSERT_TRUE(test::eventually([&] { return loops.waiting() == 0; }));
}

}  // namespace
}  // namespace stillmap::server
