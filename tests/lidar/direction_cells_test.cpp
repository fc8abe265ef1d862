#include "core/lidar/direction_cells.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

TEST(DirectionCells, GoRoundAndFromDownToUp) {
  EXPECT_EQ(DirectionCell::of({5.0F, 0.0F, 0.0F}).column, 0);
  EXPECT_EQ(DirectionCell::of({5.0F, 0.0F, 0.0F}).row, 180);
  EXPECT_EQ(DirectionCell::of({0.0F, 5.0F, 0.0F}).column, 180);
  EXPECT_EQ(DirectionCell::of({0.0F, -5.0F, 0.0F}).column, -180);
  EXPECT_EQ(DirectionCell::of({0.0F, 0.0F, -5.0F}).row, 0);
  EXPECT_EQ(DirectionCell::of({0.0F, 0.0F, 5.0F}).row, DirectionCell::rows - 1);
}

TEST(DirectionCells, MeetBehindTheLidar) {
  const DirectionCell left = DirectionCell::of({-100.0F, 0.1F, 0.0F});
  const DirectionCell right = DirectionCell::of({-100.0F, -0.1F, 0.0F});
  EXPECT_NE(left.column, right.column);
  EXPECT_EQ(left.index(), right.index());
}

TEST(DirectionCells, BeyondTheLastRowsAreThose) {
  EXPECT_EQ((DirectionCell{0, -3}.index()), (DirectionCell{0, 0}.index()));
  const DirectionCell last{DirectionCell::columns - 1, DirectionCell::rows - 1};
  EXPECT_EQ((DirectionCell{-1, DirectionCell::rows + 3}.index()), last.index());
  EXPECT_EQ(last.index(), DirectionCell::count - 1);
}

}  // namespace
}  // namespace stillmap
