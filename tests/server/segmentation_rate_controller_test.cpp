#include "server/mapping/segmentation_rate_controller.hpp"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "idl/interface/server_status.hpp"

namespace stillmap::server {
namespace {

/// What n becomes when scans come every 100 ms and the network takes so long, for ten scans.
std::uint32_t settled(SegmentationRateController& controller, double network_ms,
                      double other_stages_ms = 0.0) {
  for (int i = 0; i < 10; ++i) {
    controller.add_measurement(network_ms, other_stages_ms, 100.0);
  }
  return controller.every();
}

TEST(SegmentationRateController, TakesTheSmallestNThatTheNetworkCanKeep) {
  for (const auto& [network_ms, every] :
       {std::pair{5.0, 1U}, {90.0, 1U}, {130.0, 2U}, {190.0, 2U}, {240.0, 3U}, {950.0, 10U}}) {
    SegmentationRateController controller;
    EXPECT_EQ(settled(controller, network_ms), every) << network_ms;
  }
}

TEST(SegmentationRateController, LeavesRoomForAllElseThatIsDoneWithAScan) {
  for (const auto& [network_ms, other_stages_ms, every] :
       {std::tuple{45.0, 50.0, 1U}, {60.0, 50.0, 2U}, {45.0, 80.0, 3U}, {60.0, 150.0, 6U}}) {
    SegmentationRateController controller;
    EXPECT_EQ(settled(controller, network_ms, other_stages_ms), every)
        << network_ms << " " << other_stages_ms;
  }
}

TEST(SegmentationRateController, LooksMoreCoarselyBeforeItLeavesScansOut) {
  const std::vector<double> costs{1.0, 0.75, 0.5};
  for (const auto& [finest_ms, resolution_level, every] :
       {std::tuple{90.0, 0U, 1U}, {130.0, 1U, 1U}, {190.0, 2U, 1U}, {230.0, 2U, 2U}}) {
    SegmentationRateController controller(costs);
    for (int i = 0; i < 10; ++i) {
      controller.add_measurement(finest_ms * costs[controller.resolution_level()], 0.0, 100.0);
    }
    EXPECT_EQ(controller.resolution_level(), resolution_level) << finest_ms;
    EXPECT_EQ(controller.every(), every) << finest_ms;
    EXPECT_NEAR(controller.network_ms(), finest_ms * costs[resolution_level], 1e-9);
  }
}

TEST(SegmentationRateController, LooksCloselyAgainWithRoomToSpare) {
  SegmentationRateController controller({1.0, 0.5});
  (void)settled(controller, 190.0);
  EXPECT_EQ(controller.resolution_level(), 1U);
  EXPECT_EQ(settled(controller, 46.0), 1U);
  EXPECT_EQ(controller.resolution_level(), 1U);
  EXPECT_EQ(settled(controller, 40.0), 1U);
  EXPECT_EQ(controller.resolution_level(), 0U);
}

TEST(SegmentationRateController, TriesACloserLookThatDoesNotLastLessAndLessOften) {
  // The source says that a coarse look costs half, and it costs a third: by what it says there
  // would be room for a closer one.
  SegmentationRateController controller({1.0, 0.5});
  const auto closer_looks = [&](int scans) {
    int closer = 0;
    for (int i = 0; i < scans; ++i) {
      controller.add_measurement(controller.resolution_level() == 0 ? 120.0 : 40.0, 0.0, 100.0);
      closer += controller.resolution_level() == 0 ? 1 : 0;
    }
    return closer;
  };
  EXPECT_LT(closer_looks(1000), 40);
  EXPECT_LT(closer_looks(6000), 40);
}

TEST(SegmentationRateController, RecoversWhenTheNetworkIsFastAgain) {
  SegmentationRateController controller;
  EXPECT_EQ(settled(controller, 450.0), 5U);
  EXPECT_EQ(settled(controller, 210.0), 3U);
  EXPECT_EQ(settled(controller, 20.0), 1U);
}

TEST(SegmentationRateController, DoesNotSwingAtTheBorderOfTwoN) {
  SegmentationRateController controller;
  (void)settled(controller, 230.0);
  std::set<std::uint32_t> seen;
  for (int i = 0; i < 200; ++i) {
    controller.add_measurement(i / 10 % 2 == 0 ? 192.0 : 208.0, 0.0, 100.0);
    seen.insert(controller.every());
  }
  EXPECT_EQ(seen.size(), 1U);
}

TEST(SegmentationRateController, OneSlowRunAndOnePauseOfTheSensorChangeNothing) {
  SegmentationRateController controller;
  EXPECT_EQ(settled(controller, 50.0), 1U);
  controller.add_measurement(5000.0, 0.0, 100.0);
  EXPECT_EQ(controller.every(), 1U);
  EXPECT_EQ(settled(controller, 240.0), 3U);
  controller.add_measurement(240.0, 0.0, 60'000.0);
  EXPECT_EQ(controller.every(), 3U);
}

TEST(SegmentationRateController, TheFirstRunIsNoMeasure) {
  SegmentationRateController controller;
  controller.add_measurement(500.0, 0.0, 100.0);
  EXPECT_EQ(controller.every(), 1U);
  EXPECT_EQ(settled(controller, 30.0), 1U);
}

TEST(SegmentationRateController, BeforeTheRateIsKnownEveryScanIsDue) {
  SegmentationRateController controller;
  for (int i = 0; i < 5; ++i) controller.add_measurement(400.0, 0.0, 0.0);
  EXPECT_EQ(controller.every(), 1U);
}

TEST(EveryNthScan, IsPlainEnglish) {
  EXPECT_EQ(dds::every_nth_scan(1), "every scan");
  EXPECT_EQ(dds::every_nth_scan(2), "every 2nd scan");
  EXPECT_EQ(dds::every_nth_scan(3), "every 3rd scan");
  EXPECT_EQ(dds::every_nth_scan(4), "every 4th scan");
  EXPECT_EQ(dds::every_nth_scan(12), "every 12th scan");
  EXPECT_EQ(dds::every_nth_scan(21), "every 21st scan");
}

}  // namespace
}  // namespace stillmap::server
