#include "server/mapping/segmentation_rate_controller.hpp"

#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "idl/interface/server_status.hpp"

namespace stillmap {
namespace {

/// What n becomes when scans come every 100 ms and the network takes so long, for ten scans.
std::uint32_t settled(LabelCadence& cadence, double network_ms, double besides_ms = 0.0) {
  for (int i = 0; i < 10; ++i) {
    cadence.scan_segmented(network_ms, besides_ms, 100.0);
  }
  return cadence.every();
}

TEST(LabelCadence, TakesTheSmallestNThatTheNetworkCanKeep) {
  for (const auto& [network_ms, every] :
       {std::pair{5.0, 1U}, {90.0, 1U}, {130.0, 2U}, {190.0, 2U}, {240.0, 3U}, {950.0, 10U}}) {
    LabelCadence cadence;
    EXPECT_EQ(settled(cadence, network_ms), every) << network_ms;
  }
}

TEST(LabelCadence, LeavesRoomForAllElseThatIsDoneWithAScan) {
  for (const auto& [network_ms, besides_ms, every] :
       {std::tuple{45.0, 50.0, 1U}, {60.0, 50.0, 2U}, {45.0, 80.0, 3U}, {60.0, 150.0, 6U}}) {
    LabelCadence cadence;
    EXPECT_EQ(settled(cadence, network_ms, besides_ms), every) << network_ms << " " << besides_ms;
  }
}

TEST(LabelCadence, LooksMoreCoarselyBeforeItLeavesScansOut) {
  const std::vector<double> costs{1.0, 0.75, 0.5};
  for (const auto& [finest_ms, coarseness, every] :
       {std::tuple{90.0, 0U, 1U}, {130.0, 1U, 1U}, {190.0, 2U, 1U}, {230.0, 2U, 2U}}) {
    LabelCadence cadence(costs);
    for (int i = 0; i < 10; ++i) {
      cadence.scan_segmented(finest_ms * costs[cadence.coarseness()], 0.0, 100.0);
    }
    EXPECT_EQ(cadence.coarseness(), coarseness) << finest_ms;
    EXPECT_EQ(cadence.every(), every) << finest_ms;
    EXPECT_NEAR(cadence.network_ms(), finest_ms * costs[coarseness], 1e-9);
  }
}

TEST(LabelCadence, LooksCloselyAgainWithRoomToSpare) {
  LabelCadence cadence({1.0, 0.5});
  (void)settled(cadence, 190.0);
  EXPECT_EQ(cadence.coarseness(), 1U);
  EXPECT_EQ(settled(cadence, 46.0), 1U);
  EXPECT_EQ(cadence.coarseness(), 1U);
  EXPECT_EQ(settled(cadence, 40.0), 1U);
  EXPECT_EQ(cadence.coarseness(), 0U);
}

TEST(LabelCadence, TriesACloserLookThatDoesNotLastLessAndLessOften) {
  // The source says that a coarse look costs half, and it costs a third: by what it says there
  // would be room for a closer one.
  LabelCadence cadence({1.0, 0.5});
  const auto closer_looks = [&](int scans) {
    int closer = 0;
    for (int i = 0; i < scans; ++i) {
      cadence.scan_segmented(cadence.coarseness() == 0 ? 120.0 : 40.0, 0.0, 100.0);
      closer += cadence.coarseness() == 0 ? 1 : 0;
    }
    return closer;
  };
  EXPECT_LT(closer_looks(1000), 40);
  EXPECT_LT(closer_looks(6000), 40);
}

TEST(LabelCadence, RecoversWhenTheNetworkIsFastAgain) {
  LabelCadence cadence;
  EXPECT_EQ(settled(cadence, 450.0), 5U);
  EXPECT_EQ(settled(cadence, 210.0), 3U);
  EXPECT_EQ(settled(cadence, 20.0), 1U);
}

TEST(LabelCadence, DoesNotSwingAtTheBorderOfTwoN) {
  LabelCadence cadence;
  (void)settled(cadence, 230.0);
  std::set<std::uint32_t> seen;
  for (int i = 0; i < 200; ++i) {
    cadence.scan_segmented(i / 10 % 2 == 0 ? 192.0 : 208.0, 0.0, 100.0);
    seen.insert(cadence.every());
  }
  EXPECT_EQ(seen.size(), 1U);
}

TEST(LabelCadence, OneSlowRunAndOnePauseOfTheSensorChangeNothing) {
  LabelCadence cadence;
  EXPECT_EQ(settled(cadence, 50.0), 1U);
  cadence.scan_segmented(5000.0, 0.0, 100.0);
  EXPECT_EQ(cadence.every(), 1U);
  EXPECT_EQ(settled(cadence, 240.0), 3U);
  cadence.scan_segmented(240.0, 0.0, 60'000.0);
  EXPECT_EQ(cadence.every(), 3U);
}

TEST(LabelCadence, TheFirstRunIsNoMeasure) {
  LabelCadence cadence;
  cadence.scan_segmented(500.0, 0.0, 100.0);
  EXPECT_EQ(cadence.every(), 1U);
  EXPECT_EQ(settled(cadence, 30.0), 1U);
}

TEST(LabelCadence, BeforeTheRateIsKnownEveryScanIsDue) {
  LabelCadence cadence;
  for (int i = 0; i < 5; ++i) cadence.scan_segmented(400.0, 0.0, 0.0);
  EXPECT_EQ(cadence.every(), 1U);
}

TEST(EveryNthScan, IsPlainEnglish) {
  EXPECT_EQ(every_nth_scan(1), "every scan");
  EXPECT_EQ(every_nth_scan(2), "every 2nd scan");
  EXPECT_EQ(every_nth_scan(3), "every 3rd scan");
  EXPECT_EQ(every_nth_scan(4), "every 4th scan");
  EXPECT_EQ(every_nth_scan(12), "every 12th scan");
  EXPECT_EQ(every_nth_scan(21), "every 21st scan");
}

}  // namespace
}  // namespace stillmap
