#include "server/mapping/parallelism_controller.hpp"

#include <gtest/gtest.h>

namespace stillmap::server {
namespace {

using enum Parallelism;

/// What a scan takes on some machine, and how the controller takes it.
struct Machine {
  double within_scan_ms = 0.0;
  double across_scans_ms = 0.0;
  double room_ms = 100.0;
  ParallelismController controller{2};
  int scans_across = 0;

  void segment(int scans) {
    for (int i = 0; i < scans; ++i) {
      const Parallelism now = controller.parallelism();
      scans_across += now == across_scans ? 1 : 0;
      controller.add_measurement(now, now == across_scans ? across_scans_ms : within_scan_ms,
                                 room_ms);
    }
  }
};

TEST(ParallelismController, AllCoresShareAScanWhileTheyKeepTheRate) {
  Machine machine{.within_scan_ms = 90.0, .across_scans_ms = 100.0};
  machine.segment(1000);
  EXPECT_EQ(machine.scans_across, 0);
  EXPECT_EQ(machine.controller.scans_at_a_time(), 1U);
}

TEST(ParallelismController, CoresTakeAScanEachWhereThatSavesTheRate) {
  Machine machine{.within_scan_ms = 130.0, .across_scans_ms = 180.0};
  machine.segment(10);
  EXPECT_EQ(machine.controller.parallelism(), across_scans);
  EXPECT_EQ(machine.controller.scans_at_a_time(), 2U);
  machine.segment(2000);
  EXPECT_GT(machine.scans_across, 1900);
}

TEST(ParallelismController, ATrialThatIsNoBetterIsSeldomRepeated) {
  Machine machine{.within_scan_ms = 130.0, .across_scans_ms = 250.0};
  machine.segment(2000);
  EXPECT_EQ(machine.controller.parallelism(), within_scan);
  EXPECT_GT(machine.scans_across, 0);
  EXPECT_LT(machine.scans_across, 60);
}

TEST(ParallelismController, GoesBackWhenTheLoadIsGone) {
  Machine machine{.within_scan_ms = 130.0, .across_scans_ms = 180.0};
  machine.segment(1000);
  machine.within_scan_ms = 30.0;
  machine.across_scans_ms = 50.0;
  machine.segment(310);
  EXPECT_EQ(machine.controller.parallelism(), within_scan);
}

TEST(ParallelismController, OneSlowScanAndTheFirstOneChangeNothing) {
  Machine machine{.within_scan_ms = 900.0, .across_scans_ms = 50.0};
  machine.segment(1);
  machine.within_scan_ms = 30.0;
  machine.segment(10);
  machine.within_scan_ms = 900.0;
  machine.segment(1);
  machine.within_scan_ms = 30.0;
  machine.segment(10);
  EXPECT_EQ(machine.scans_across, 0);
}

TEST(ParallelismController, HasNothingToChooseWithOneScanAtATimeOrWithoutARate) {
  Machine one_core{.within_scan_ms = 500.0, .across_scans_ms = 500.0};
  one_core.controller = ParallelismController(1);
  one_core.segment(50);
  Machine without_rate{.within_scan_ms = 500.0, .across_scans_ms = 500.0, .room_ms = 0.0};
  without_rate.segment(50);
  EXPECT_TRUE(one_core.controller.is_settled());
  EXPECT_EQ(one_core.scans_across + without_rate.scans_across, 0);
}

TEST(ParallelismController, ScansBegunBeforeAChangeDoNotCount) {
  Machine machine{.within_scan_ms = 130.0, .across_scans_ms = 180.0};
  machine.segment(3);
  ASSERT_EQ(machine.controller.parallelism(), across_scans);
  machine.controller.add_measurement(within_scan, 1.0, 100.0);
  EXPECT_FALSE(machine.controller.is_settled());
  machine.segment(3);
  EXPECT_TRUE(machine.controller.is_settled());
}

}  // namespace
}  // namespace stillmap::server
