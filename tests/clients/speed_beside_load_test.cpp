#include "clients/commands/model/speed_beside_load.hpp"

#include <gtest/gtest.h>

#include "clients/commands/model/benchmark_scan.hpp"
#include "config/loaders/model_file.hpp"
#include "config/loaders/model_folder.hpp"
#include "core/segmentation/network_segmenter.hpp"

namespace stillmap::cli {
namespace {

// How large the share is hangs on the machine and on its other programs:
// `stillmap model speed --beside` measures it.
TEST(SpeedBesideLoad, AccountsForTheProcessorTimeOfScansAndLoopsInBothParallelisms) {
  const auto segmenter = open_model(load_model_description(find_model("street")));
  if (segmenter->concurrent_scans() == 1) GTEST_SKIP() << "one core";
  const auto speeds = measure_beside_load(*segmenter, benchmark_scan(), {0, 2}, 1, 0.2);
  ASSERT_EQ(speeds.size(), 4U);
  for (std::size_t i = 0; i < speeds.size(); ++i) {
    const SpeedBesideLoad& speed = speeds[i];
    EXPECT_EQ(speed.loops, i < 2 ? 0U : 2U);
    EXPECT_EQ(speed.parallelism, i % 2 == 0 ? Parallelism::within_scan : Parallelism::across_scans);
    EXPECT_GT(speed.scans, 0U);
    EXPECT_GE(speed.wall_s, 0.2);
    EXPECT_GT(speed.cpu_s, 0.0);
    EXPECT_GE(speed.available_s, speed.cpu_s - 1e-6);
    EXPECT_GT(speed.scan_ms, 0.0);
    EXPECT_GT(speed.of_fair_share, 0.0);
  }
}

}  // namespace
}  // namespace stillmap::cli
