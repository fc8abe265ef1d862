#include "core/lidar/sweep_merger.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

namespace stillmap {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::int64_t ms = 1'000'000;
constexpr double deg = std::numbers::pi / 180.0;

/// A scan of one point, whose x tells where it comes from.
Scan scan_at(std::int64_t stamp_ms, float x) {
  Scan scan;
  scan.stamp_ns = stamp_ms * ms;
  scan.points_lidar = {{x, 0.0F, 0.0F}};
  return scan;
}

std::vector<float> xs(const Scan& scan) {
  std::vector<float> values;
  for (const Eigen::Vector3f& point : scan.points_lidar) values.push_back(point.x());
  return values;
}

TEST(MergedScan, KeepsTheTimeOfEveryPoint) {
  Scan front = scan_at(1000, 1.0F);
  front.time_offset_s = {0.02F};
  Scan rear = scan_at(1030, 2.0F);
  rear.time_offset_s = {-0.01F};
  const Scan merged = merged_scan({front, rear});
  EXPECT_EQ(merged.stamp_ns, 1000 * ms);
  ASSERT_EQ(merged.time_offset_s.size(), 2U);
  EXPECT_FLOAT_EQ(merged.time_offset_s[0], 0.02F);
  EXPECT_FLOAT_EQ(merged.time_offset_s[1], 0.02F);
}

TEST(MergedScan, GivesPointsWithoutTimesThatOfTheirStamp) {
  const Scan merged = merged_scan({scan_at(1040, 1.0F), scan_at(1000, 2.0F)});
  EXPECT_EQ(merged.stamp_ns, 1000 * ms);
  EXPECT_THAT(merged.time_offset_s, ElementsAre(0.04F, 0.0F));
}

TEST(MergedScan, NeedsNoTimesForScansOfOneInstant) {
  EXPECT_THAT(merged_scan({scan_at(1000, 1.0F), scan_at(1000, 2.0F)}).time_offset_s, IsEmpty());
}

TEST(MergedScan, FillsUpWhatOneLidarDoesNotHave) {
  Scan front = scan_at(1000, 1.0F);
  front.intensity = {0.5F};
  front.labels = {SemanticClass::car};
  front.ring = {7};
  const Scan merged = merged_scan({scan_at(1000, 2.0F), front});
  EXPECT_THAT(merged.intensity, ElementsAre(0.5F, 0.5F)) << "dark would be an observation";
  EXPECT_THAT(merged.labels, ElementsAre(SemanticClass::unlabeled, SemanticClass::car));
  EXPECT_THAT(merged.ring, IsEmpty());
}

TEST(MergedScan, LeavesLabelsOfSomeLidarsOutWhereAskedTo) {
  Scan labelled = scan_at(1000, 1.0F);
  labelled.labels = {SemanticClass::car};
  Scan unfilled = scan_at(1000, 2.0F);
  unfilled.labels = {SemanticClass::unlabeled};
  const auto drop = PartialLabels::drop;
  EXPECT_THAT(merged_scan({labelled, scan_at(1000, 2.0F)}, drop).labels, IsEmpty());
  EXPECT_THAT(merged_scan({unfilled, unfilled}, drop).labels, IsEmpty());
  EXPECT_THAT(merged_scan({labelled, labelled}, drop).labels,
              ElementsAre(SemanticClass::car, SemanticClass::car));
}

TEST(MergedScan, KeepsLabelsBesideAScanOfNoPointsOrOfPointsThatNobodyKnows) {
  Scan labelled = scan_at(1000, 1.0F);
  labelled.labels = {SemanticClass::car};
  Scan unknown = scan_at(1000, 2.0F);
  unknown.labels = {SemanticClass::unlabeled};
  const auto drop = PartialLabels::drop;
  EXPECT_THAT(merged_scan({labelled, Scan{}}, drop).labels, ElementsAre(SemanticClass::car));
  EXPECT_THAT(merged_scan({labelled, unknown}, std::vector{true, true}, drop).labels,
              ElementsAre(SemanticClass::car, SemanticClass::unlabeled));
  EXPECT_THAT(merged_scan({labelled, unknown}, std::vector{true, false}, drop).labels, IsEmpty());
}

TEST(MergedScan, OfNothingIsEmpty) { EXPECT_TRUE(merged_scan({}).empty()); }

TEST(MergedFrame, LiesInTheMiddleOfTheLidars) {
  const std::vector<Eigen::Isometry3d> lidars{
      Eigen::Isometry3d(Eigen::Translation3d(1.0, 0.5, 2.0) *
                        Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitY())),
      Eigen::Isometry3d(Eigen::Translation3d(-2.0, 0.5, 1.0))};
  const Eigen::Isometry3d T_base_merged = merged_frame(lidars);
  EXPECT_TRUE(T_base_merged.translation().isApprox(Eigen::Vector3d(-0.5, 0.5, 1.5)));
  EXPECT_TRUE(T_base_merged.linear().isIdentity());
}

TEST(MergedSensor, SeesWhatTiltedLidarsSee) {
  PlacedSensor level{.sensor = vlp_16()};
  PlacedSensor tilted{.sensor = vlp_16()};
  tilted.T_merged_lidar = Eigen::AngleAxisd(30.0 * deg, Eigen::Vector3d::UnitY());
  const SensorModel merged = merged_sensor(std::vector{level, tilted});
  EXPECT_THAT(merged.faults(), IsEmpty());
  EXPECT_EQ(merged.rings, 32);
  EXPECT_EQ(merged.pattern, ScanPattern::merged);
  EXPECT_GE(merged.fov_up, 45.9 * deg);
  EXPECT_LE(merged.fov_up, 49.0 * deg);
  EXPECT_LE(merged.fov_down, -45.9 * deg);
}

TEST(MergedSensor, HasTheImuWhereItsLidarHasIt) {
  PlacedSensor without{.sensor = vlp_16()};
  PlacedSensor with{.sensor = vlp_16()};
  with.T_merged_lidar = Eigen::AngleAxisd(30.0 * deg, Eigen::Vector3d::UnitY());
  const Eigen::AngleAxisd of_imu(90.0 * deg, Eigen::Vector3d::UnitZ());
  with.sensor.imu = ImuMount{.R_lidar_imu = of_imu.toRotationMatrix(), .time_offset_s = 0.01};
  const SensorModel merged = merged_sensor(std::vector{without, with});
  ASSERT_TRUE(merged.imu);
  EXPECT_TRUE(
      merged.imu->R_lidar_imu.isApprox(with.T_merged_lidar.linear() * of_imu.toRotationMatrix()));
  EXPECT_EQ(merged.imu->time_offset_s, 0.01);
}

TEST(MergedSensor, OfALidarOnItsSideHasNoMoreThanASphere) {
  PlacedSensor sideways{.sensor = hdl_32e()};
  sideways.T_merged_lidar = Eigen::AngleAxisd(90.0 * deg, Eigen::Vector3d::UnitX());
  EXPECT_THAT(merged_sensor(std::vector{sideways, sideways}).faults(), IsEmpty());
}

class Merger : public testing::Test {
 protected:
  SweepMerger merger_{{.lidars = 2, .period_s = 0.1, .max_wait_s = 0.05}};
};

TEST_F(Merger, WaitsForTheOtherLidar) {
  EXPECT_EQ(merger_.add(0, scan_at(1000, 1.0F), 0.0), 0U);
  EXPECT_FALSE(merger_.next(0.01));
  EXPECT_EQ(merger_.add(1, scan_at(1040, 2.0F), 0.02), 0U);
  const auto sweep = merger_.next(0.02);
  ASSERT_TRUE(sweep);
  EXPECT_THAT(xs(sweep->scan), ElementsAre(1.0F, 2.0F));
  EXPECT_THAT(sweep->missing, IsEmpty());
  EXPECT_FALSE(merger_.next(10.0));
}

TEST_F(Merger, TellsThatOnlySomeLidarsSendLabels) {
  Scan labelled = scan_at(1000, 1.0F);
  labelled.labels = {SemanticClass::car};
  EXPECT_EQ(merger_.add(0, labelled, 0.0), 0U);
  EXPECT_EQ(merger_.add(1, scan_at(1000, 2.0F), 0.0), 0U);
  const auto sweep = merger_.next(0.0);
  ASSERT_TRUE(sweep);
  EXPECT_TRUE(sweep->is_partly_labelled);
  EXPECT_THAT(sweep->scan.labels, ElementsAre(SemanticClass::car, SemanticClass::unlabeled));
}

TEST(SweepMerger, RemembersWhichLidarsSendLabels) {
  SweepMerger merger({.lidars = 2, .partial_labels = PartialLabels::drop});
  const auto sweep_of = [&](std::int64_t stamp_ms, SemanticClass front, SemanticClass rear) {
    Scan scans[] = {scan_at(stamp_ms, 1.0F), scan_at(stamp_ms, 2.0F)};
    scans[0].labels = {front};
    scans[1].labels = {rear};
    EXPECT_EQ(merger.add(0, scans[0], 0.0) + merger.add(1, scans[1], 0.0), 0U);
    return merger.next(0.0).value();
  };
  constexpr auto unknown = SemanticClass::unlabeled, car = SemanticClass::car;
  EXPECT_TRUE(sweep_of(1000, car, unknown).is_partly_labelled) << "a field that nobody fills";
  EXPECT_FALSE(sweep_of(1100, car, car).is_partly_labelled);
  const auto sweep = sweep_of(1200, car, unknown);
  EXPECT_FALSE(sweep.is_partly_labelled) << "it stands before a thing that has no class";
  EXPECT_THAT(sweep.scan.labels, ElementsAre(car, unknown));
}

TEST(SweepMerger, ForgetsThatALidarSentLabelsWhenItsScansHaveNone) {
  SweepMerger merger({.lidars = 2, .partial_labels = PartialLabels::drop});
  Scan front = scan_at(1000, 1.0F), rear = scan_at(1000, 2.0F);
  front.labels = rear.labels = {SemanticClass::car};
  const auto sweep_of = [&](std::int64_t stamp_ms, Scan from_rear) {
    front.stamp_ns = from_rear.stamp_ns = stamp_ms * ms;
    EXPECT_EQ(merger.add(0, front, 0.0) + merger.add(1, std::move(from_rear), 0.0), 0U);
    return merger.next(0.0).value();
  };
  EXPECT_FALSE(sweep_of(1000, rear).is_partly_labelled);
  EXPECT_FALSE(sweep_of(1100, Scan{}).is_partly_labelled) << "nothing was within its range";
  const auto without = sweep_of(1200, scan_at(1200, 2.0F));
  EXPECT_TRUE(without.is_partly_labelled) << "its driver was started again, without labels";
  EXPECT_THAT(without.scan.labels, IsEmpty()) << "the network labels all points";
  EXPECT_FALSE(sweep_of(1300, rear).is_partly_labelled);
}

TEST_F(Merger, PairsScansByStampNotByArrival) {
  // The first one comes while the other still sends the sweep before.
  EXPECT_EQ(merger_.add(1, scan_at(940, 2.0F), 0.0), 0U);
  EXPECT_EQ(merger_.add(0, scan_at(1000, 1.0F), 0.01), 0U);
  const auto alone = merger_.next(0.01);
  ASSERT_TRUE(alone);
  EXPECT_THAT(xs(alone->scan), ElementsAre(2.0F));
  EXPECT_THAT(alone->missing, ElementsAre(0U));
  EXPECT_FALSE(merger_.next(0.01));
  EXPECT_EQ(merger_.add(1, scan_at(1040, 3.0F), 0.04), 0U);
  EXPECT_THAT(xs(merger_.next(0.04)->scan), ElementsAre(1.0F, 3.0F));
}

TEST_F(Merger, GoesOnWithoutALidarThatFallsSilent) {
  EXPECT_EQ(merger_.add(0, scan_at(1000, 1.0F), 0.0), 0U);
  EXPECT_FALSE(merger_.next(0.049));
  const auto sweep = merger_.next(0.051);
  ASSERT_TRUE(sweep);
  EXPECT_THAT(sweep->missing, ElementsAre(1U));
  // From now on nothing waits for it,
  EXPECT_EQ(merger_.add(0, scan_at(1100, 1.0F), 0.1), 0U);
  EXPECT_TRUE(merger_.next(0.1));
  // until it sends again.
  EXPECT_EQ(merger_.add(1, scan_at(1200, 2.0F), 0.2), 0U);
  EXPECT_FALSE(merger_.next(0.2));
  EXPECT_EQ(merger_.add(0, scan_at(1200, 1.0F), 0.21), 0U);
  EXPECT_THAT(merger_.next(0.21)->missing, IsEmpty());
}

TEST_F(Merger, LeavesOutAScanThatComesAfterItsSweep) {
  EXPECT_EQ(merger_.add(0, scan_at(1000, 1.0F), 0.0), 0U);
  ASSERT_TRUE(merger_.next(0.06));
  EXPECT_EQ(merger_.add(1, scan_at(990, 2.0F), 0.07), 1U);
  EXPECT_FALSE(merger_.next(1.0));
}

TEST_F(Merger, TakesAClockThatWasSetBack) {
  EXPECT_EQ(merger_.add(0, scan_at(100'000, 1.0F), 0.0), 0U);
  ASSERT_TRUE(merger_.next(0.06));
  EXPECT_EQ(merger_.add(0, scan_at(2000, 1.0F), 0.1), 0U);
  EXPECT_TRUE(merger_.next(0.2));
}

TEST_F(Merger, GoesOnByOneClockWhereClocksDiffer) {
  std::size_t lost = 0;
  const auto take_all = [&](double now_s) {
    while (const auto sweep = merger_.next(now_s)) {
      EXPECT_THAT(xs(sweep->scan), ElementsAre(1.0F)) << now_s;
      EXPECT_THAT(sweep->missing, ElementsAre(1U)) << now_s;
    }
  };
  for (int i = 0; i < 100; ++i) {
    const double now_s = 0.1 * i;
    lost += merger_.add(0, scan_at(1000 + 100 * i, 1.0F), now_s);
    if (i > 0) take_all(now_s);
    lost += merger_.add(1, scan_at(38'000 + 100 * i, 2.0F), now_s + 0.03);
    take_all(now_s + 0.03);
    take_all(now_s + 0.09);
  }
  EXPECT_LE(merger_.waiting(1), 8U);
  EXPECT_EQ(lost, 92U);
}

TEST_F(Merger, GoesOnWhereAllClocksAreSetForward) {
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(merger_.add(0, scan_at(1000 + 100 * i, 1.0F), 0.1 * i), 0U);
    EXPECT_EQ(merger_.add(1, scan_at(1000 + 100 * i, 2.0F), 0.1 * i), 0U);
    ASSERT_TRUE(merger_.next(0.1 * i));
  }
  EXPECT_EQ(merger_.add(0, scan_at(38'500, 1.0F), 0.5), 0U);
  EXPECT_EQ(merger_.add(1, scan_at(38'500, 2.0F), 0.52), 0U);
  EXPECT_THAT(merger_.next(0.52)->missing, IsEmpty());
  // Once more, and one falls silent with that.
  EXPECT_EQ(merger_.add(0, scan_at(80'000, 1.0F), 0.6), 0U);
  EXPECT_FALSE(merger_.next(0.7));
  EXPECT_THAT(merger_.next(1.6)->missing, ElementsAre(1U));
}

/// Of scans that a lidar sends from `begin_ms` on, when they end, for 20 s.
struct Sender {
  std::int64_t period_ms;
  std::int64_t begin_ms;
};

/// Scans of each of two lidars that go into sweeps.
std::vector<std::size_t> merged_of(SweepMerger merger, const std::vector<Sender>& senders) {
  std::vector<std::size_t> merged(senders.size(), 0);
  for (std::int64_t now_ms = 0; now_ms < 20'000; ++now_ms) {
    const double now_s = 0.001 * static_cast<double>(now_ms);
    for (std::size_t lidar = 0; lidar < senders.size(); ++lidar) {
      const std::int64_t begun_ms = now_ms - senders[lidar].period_ms - senders[lidar].begin_ms;
      if (begun_ms < 0 || begun_ms % senders[lidar].period_ms != 0) continue;
      const std::int64_t stamp_ms = 1000 + now_ms - senders[lidar].period_ms;
      (void)merger.add(lidar, scan_at(stamp_ms, static_cast<float>(lidar)), now_s);
    }
    while (const auto sweep = merger.next(now_s)) {
      // Rates have to show first.
      const bool is_known = now_ms > 1000;
      EXPECT_TRUE(!is_known || sweep->missing.empty()) << now_ms << " ms";
      for (const float x : xs(sweep->scan)) merged[static_cast<std::size_t>(x)] += 1;
    }
  }
  return merged;
}

TEST(MergerOfDifferentRates, LosesNoScans) {
  const SweepMerger merger({.lidars = 2, .period_s = 0.1, .max_wait_s = 0.1});
  for (const std::int64_t later_ms : {0, 10, 25}) {
    const auto merged = merged_of(merger, {{100, 0}, {50, later_ms}});
    EXPECT_GE(merged[0], 196U) << later_ms;
    EXPECT_GE(merged[1], 395U) << later_ms;
  }
  const SweepMerger rare_merger({.lidars = 2, .period_s = 0.2, .max_wait_s = 0.2});
  const auto merged = merged_of(rare_merger, {{100, 0}, {200, 10}});
  EXPECT_GE(merged[0], 195U);
  EXPECT_GE(merged[1], 97U);
}

}  // namespace
}  // namespace stillmap
