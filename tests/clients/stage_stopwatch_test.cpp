#include "clients/commands/stage_stopwatch.hpp"

#include <gtest/gtest.h>

#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

TEST(Table, AlignsColumnsAndFillsMissingCells) {
  Table table({"class", "voxels"});
  table.add({"road", "12345"});
  table.add({"pole"});
  EXPECT_EQ(table.text(), "class  voxels\n-------------\nroad    12345\npole         \n");
}

TEST(StageDurations, QuantileIsAValueThatOccurred) {
  const StageDurations stage{.stage = "odometry", .ms = {4.0, 1.0, 3.0, 2.0}};
  EXPECT_DOUBLE_EQ(stage.quantile(0.0), 1.0);
  EXPECT_DOUBLE_EQ(stage.quantile(0.5), 2.0);
  EXPECT_DOUBLE_EQ(stage.quantile(0.95), 4.0);
  EXPECT_DOUBLE_EQ(StageDurations{}.quantile(0.5), 0.0);
}

TEST(StageStopwatch, KeepStagesInTheirOrderWithTheTotalLast) {
  StageStopwatch times;
  for (int scan = 0; scan < 3; ++scan) {
    times.begin();
    times.end_stage("prepare");
    times.end_stage("odometry");
    times.end();
  }
  const auto stages = times.stages();
  ASSERT_EQ(stages.size(), 3U);
  EXPECT_EQ(stages[0].stage, "prepare");
  EXPECT_EQ(stages[1].stage, "odometry");
  EXPECT_EQ(stages[2].stage, "total");
  EXPECT_EQ(stages[2].ms.size(), 3U);
}

}  // namespace
}  // namespace stillmap::cli
