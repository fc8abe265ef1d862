#include "server/mapping/loop_corrector.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>

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
      scan->scan.stamp_ns = static_cast<std::int64_t>(1e8 * (10.0 + way_m_)) + clock_offset_ns;
      loops_.add(scan, T_odom_lidar_, Eigen::Isometry3d::Identity(), entry(way_m_));
      if (!takes) continue;
      if (auto correction = loops_.take()) corrections.push_back(*std::move(correction));
    }
    ASSERT_TRUE(test::eventually([&] { return loops_.waiting() == 0; }));
  }

  bool takes = true;
  std::function<MapEntry(double way_m)> entry = [](double) { return MapEntry::enters; };
  std::int64_t clock_offset_ns = 0;
  std::vector<MapCorrection> corrections;

 private:
  LoopCorrector& loops_;
  StreetWorld world_{11};
  double way_m_ = 0.0;
  std::optional<Eigen::Isometry3d> T_last_;
  Eigen::Isometry3d T_odom_lidar_ = Eigen::Isometry3d::Identity();
};

std::vector<LabelledPoint> nothing_seen(std::int64_t, const Eigen::Vector2d&, double) { return {}; }

std::uint64_t counted(const Statistics& statistics, const std::string& counter) {
  dds::ServerStatus status;
  statistics.report_to(status);
  return status.counter(counter);
}

std::uint64_t closed(const Statistics& statistics) { return counted(statistics, "loops_closed"); }

TEST(LoopCorrector, SaysBesideTheDriveWhatIsToBeMoved) {
  Statistics statistics;
  LoopCorrector loops({}, true, statistics, nothing_seen);
  loops.begin_map();
  Round round(loops);
  round.go(1.25 * StreetWorld::length_m);
  ASSERT_TRUE(test::eventually([&] {
    if (auto correction = loops.take()) round.corrections.push_back(*std::move(correction));
    return !round.corrections.empty();
  }));
  EXPECT_GT(closed(statistics), 0U);
  EXPECT_GT(round.corrections.front().latest().translation().norm(), 0.1);
}

TEST(LoopCorrector, TakesAStretchThatHasWaitedOnceItEntersTheMap) {
  constexpr double begin_m = 40.0, end_m = 90.0;
  const auto submaps_with = [](MapEntry last) {
    Statistics statistics;
    LoopCorrector loops({}, true, statistics, nothing_seen);
    loops.begin_map();
    Round round(loops);
    round.entry = [&](double way_m) {
      if (way_m < begin_m || way_m > end_m) return MapEntry::enters;
      if (way_m == end_m) return last;
      return way_m == begin_m + 10.0 ? MapEntry::stays_out : MapEntry::waits;
    };
    round.go(begin_m + 1.0);
    round.go(end_m);
    std::optional<SubmapList> list;
    EXPECT_TRUE(test::eventually([&] { return (list = loops.take_submaps()).has_value(); }));
    EXPECT_EQ(list->submaps.size(), 1U) << "of what is before the stretch";
    round.go(end_m + 30.0);
    EXPECT_TRUE(test::eventually([&] { return (list = loops.take_submaps()).has_value(); }));
    return list->submaps;
  };
  const auto entered = submaps_with(MapEntry::enters_with_waiting);
  const auto dropped = submaps_with(MapEntry::enters);
  ASSERT_GE(entered.size(), 4U);
  EXPECT_LT(dropped.size(), entered.size());
  EXPECT_LT(entered[2].way_m - entered[1].way_m, 35.0) << "the stretch is cut as all else";
}

TEST(LoopCorrector, TellsSubmapsOnlyAsTheMapHasThem) {
  Statistics statistics;
  LoopCorrector loops({}, true, statistics, nothing_seen);
  loops.begin_map();
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

  // The robot is set elsewhere in the map: clients count on with the submaps that they know.
  const SubmapList before = *list;
  loops.go_on_in_map(std::numeric_limits<std::int64_t>::min());
  Round elsewhere(loops);
  elsewhere.clock_offset_ns = 1'000'000'000'000;
  elsewhere.go(0.5 * StreetWorld::length_m);
  ASSERT_TRUE(test::eventually([&] { return (list = loops.take_submaps()).has_value(); }));
  ASSERT_GT(list->submaps.size(), before.submaps.size());
  EXPECT_EQ(list->graph_revision, before.graph_revision);
  EXPECT_EQ(list->loops.size(), before.loops.size());
  for (std::size_t i = 0; i < before.submaps.size(); ++i) {
    EXPECT_EQ(list->submaps[i].stamp_ns, before.submaps[i].stamp_ns);
    EXPECT_GT(list->submaps.back().way_m, before.submaps[i].way_m);
  }

  loops.begin_map();
  EXPECT_FALSE(loops.take_submaps()) << "of the map before";
}

TEST(LoopCorrector, SaysNothingWhereLoopsStayOpenAndOfAMapThatIsNoMore) {
  Statistics statistics;
  LoopCorrector loops({}, true, statistics, nothing_seen);
  loops.end_map();
  Round open(loops);
  open.go(1.25 * StreetWorld::length_m);
  EXPECT_TRUE(open.corrections.empty());
  EXPECT_EQ(closed(statistics), 0U);
  loops.begin_map();
  Round round(loops);
  round.takes = false;
  round.go(1.25 * StreetWorld::length_m);
  ASSERT_TRUE(test::eventually([&] { return closed(statistics) > 0; }));
  loops.begin_map();
  EXPECT_FALSE(loops.take());
}

TEST(LoopCorrector, InAMapThatWasThereMovesWhatIsSeenAfterItsLastScan) {
  constexpr std::int64_t last_ns = 900'000'000;
  std::atomic<bool> asked_otherwise = false;
  const auto street = StreetWorld(11).earlier_map(-30.0, 60.0, 7);
  const auto seen_until = [&](std::int64_t stamp_ns, const Eigen::Vector2d& at, double radius_m) {
    if (stamp_ns != last_ns) asked_otherwise = true;
    return street(at, radius_m);
  };
  Statistics statistics;
  LoopCorrector loops({}, true, statistics, seen_until);
  loops.begin_in_map(last_ns);
  loops.add(GnssFix{});
  Round round(loops);
  round.go(1.2 * StreetWorld::length_m);
  ASSERT_TRUE(test::eventually([&] {
    if (auto correction = loops.take()) round.corrections.push_back(*std::move(correction));
    // Where the round ends, not the little that is off when it leaves the map.
    return std::ranges::any_of(round.corrections, [](const MapCorrection& correction) {
      return correction.latest().translation().norm() > 0.5;
    });
  }));
  EXPECT_FALSE(asked_otherwise);
  EXPECT_EQ(round.corrections.back().at(last_ns), nullptr);
  EXPECT_GE(counted(statistics, "submaps_in_earlier_map"), 4U);
  EXPECT_EQ(counted(statistics, "gnss_fixes_unused"), 1U);
}

TEST(LoopCorrector, LeavesLoopsOpenInALoadedMapOfWhichNobodyKnowsUntilWhenItWasSeen) {
  Statistics statistics;
  LoopCorrector loops({}, true, statistics, nothing_seen);
  loops.begin_open();
  loops.go_on_in_map(1);
  Round round(loops);
  round.go(1.25 * StreetWorld::length_m);
  EXPECT_TRUE(round.corrections.empty());
  EXPECT_FALSE(loops.take_submaps());
}

// A robot that drives for days in a map that was loaded.
TEST(LoopCorrector, TakesTheMapAsItIsForTheEarlierOneWhereItsGraphGrowsTooLarge) {
  const auto street = StreetWorld(11).earlier_map(-30.0, 60.0, 7);
  std::atomic<std::int64_t> asked_ns = 0;
  const auto seen_until = [&](std::int64_t stamp_ns, const Eigen::Vector2d& at, double radius_m) {
    asked_ns = stamp_ns;
    return street(at, radius_m);
  };
  LiveLoopConfig small;
  small.max_nodes = 300;
  Statistics statistics;
  LoopCorrector loops(small, true, statistics, seen_until);
  loops.begin_in_map(900'000'000);
  Round round(loops);
  const auto carry_out = [&] {
    while (auto correction = loops.take()) {
      loops.report(*correction, {}, 1.0);
      round.corrections.push_back(*std::move(correction));
    }
  };
  round.takes = false;
  round.go(0.95 * StreetWorld::length_m);
  carry_out();
  EXPECT_FALSE(loops.take_full()) << "it is off the map";
  EXPECT_TRUE(loops.is_off_earlier_map());
  round.go(1.15 * StreetWorld::length_m);
  ASSERT_TRUE(test::eventually([&] {
    carry_out();
    return loops.take_full();
  }));
  EXPECT_FALSE(loops.is_off_earlier_map());
  const std::size_t corrections = round.corrections.size();
  ASSERT_GT(corrections, 0U);

  constexpr std::int64_t now_ns = 40'000'000'000;
  loops.settle(now_ns);
  round.clock_offset_ns = now_ns;
  round.go(1.2 * StreetWorld::length_m + 30.0);
  ASSERT_TRUE(test::eventually([&] { return asked_ns == now_ns; }));
  carry_out();
  // It goes on where it was, not where odometry has it.
  for (std::size_t i = corrections; i < round.corrections.size(); ++i)
    EXPECT_LT(round.corrections[i].latest().translation().norm(), 0.5);
  EXPECT_FALSE(loops.take_full()) << "its graph is a small one again";
}

TEST(LoopCorrector, MovesNothingByTimesThatCameTwice) {
  Statistics statistics;
  LoopCorrector loops({}, true, statistics, nothing_seen);
  loops.begin_map();
  Round round(loops);
  round.takes = false;
  round.go(1.25 * StreetWorld::length_m);
  ASSERT_TRUE(test::eventually([&] { return closed(statistics) > 0; }));
  auto again = std::make_shared<LabelledScan>();
  again->scan.stamp_ns = 1;
  loops.add(again, Eigen::Isometry3d::Identity(), Eigen::Isometry3d::Identity(), MapEntry::enters);
  ASSERT_TRUE(test::eventually([&] { return loops.waiting() == 0; }));
  EXPECT_FALSE(loops.take());
  // Nor where the robot is set elsewhere after that: what was seen then has stamps of what comes.
  loops.go_on_in_map(1);
  Round elsewhere(loops);
  elsewhere.takes = false;
  elsewhere.go(1.25 * StreetWorld::length_m);
  EXPECT_FALSE(loops.take());
}

TEST(LoopCorrector, LeavesOutScansOfALiveSensorThatItCannotLookAt) {
  Statistics statistics;
  LoopCorrector loops({}, false, statistics, nothing_seen);
  loops.begin_map();
  const StreetWorld world(11);
  for (int k = 0; k < 200; ++k) {
    auto scan = std::make_shared<LabelledScan>();
    if (k % 100 == 0) *scan = world.scan_at(world.T_map_lidar_at(k, false), 1);
    scan->scan.stamp_ns = 1 + k;
    loops.add(scan, Eigen::Isometry3d(Eigen::Translation3d(k, 0, 0)), Eigen::Isometry3d::Identity(),
              MapEntry::enters);
    EXPECT_LE(loops.waiting(), 20U);
  }
  ASSERT_TRUE(test::eventually([&] { return loops.waiting() == 0; }));
}

}  // namespace
}  // namespace stillmap::server
