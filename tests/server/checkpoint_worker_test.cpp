#include <gtest/gtest.h>

#include "server/mapping/map_saver.hpp"
#include "tests/server/manual_clock.hpp"

namespace stillmap::server {
namespace {

using Seconds = std::chrono::duration<double>;

TEST(DueAfterBegin, LeavesTimeForTheSaveItself) {
  EXPECT_EQ(due_after_begin(Seconds(5.0), Seconds(0.0)), Seconds(5.0));
  EXPECT_EQ(due_after_begin(Seconds(5.0), Seconds(1.0)), Seconds(3.5));
}

TEST(DueAfterBegin, LeavesTimeBetweenSavesThatTakeTooLong) {
  EXPECT_EQ(due_after_begin(Seconds(5.0), Seconds(4.0)), Seconds(2.5));
  EXPECT_EQ(due_after_begin(Seconds(5.0), Seconds(60.0)), Seconds(2.5));
}

TEST(CheckpointWorker, BeginsTheNextSaveBeforeThePeriodIsOver) {
  test::ManualClock clock;
  int saves = 0;
  const CheckpointWorker worker(
      Seconds(4.0),
      [&] {
        clock.advance(Seconds(1.0));
        ++saves;
      },
      clock);
  for (int save = 1; save <= 4; ++save) {
    const auto pause = clock.wait_for_sleeper();
    ASSERT_TRUE(pause);
    EXPECT_EQ(saves, save);
    EXPECT_NEAR(pause->count(), 1.5, 1e-6) << "2.5 s after the begin, of which the save took 1 s";
    clock.advance(*pause);
  }
}

TEST(CheckpointWorker, SchedulesByTheLongestOfTheLastSaves) {
  test::ManualClock clock;
  Seconds duration(1.0);
  const CheckpointWorker worker(
      Seconds(4.0), [&] { clock.advance(duration); }, clock);
  ASSERT_TRUE(clock.wait_for_sleeper());
  duration = Seconds(0.5);
  clock.advance(*clock.wait_for_sleeper());
  const auto pause = clock.wait_for_sleeper();
  ASSERT_TRUE(pause);
  EXPECT_NEAR(pause->count(), 2.0, 1e-6);
}

TEST(CheckpointWorker, LetsOthersHaveTheirTurnWhereSavesTakeLongerThanThePeriod) {
  test::ManualClock clock;
  const CheckpointWorker worker(
      Seconds(1.0), [&] { clock.advance(Seconds(4.0)); }, clock);
  for (int save = 0; save < 3; ++save) {
    const auto pause = clock.wait_for_sleeper();
    ASSERT_TRUE(pause);
    EXPECT_NEAR(pause->count(), 0.4, 1e-6);
    clock.advance(*pause);
  }
}

TEST(CheckpointWorker, GoesOnAfterAFailureAndStopsAtOnceWhileItWaits) {
  test::ManualClock clock;
  int saves = 0;
  {
    const CheckpointWorker worker(
        Seconds(3600.0),
        [&] {
          ++saves;
          throw MapFileError("map.stillmap", "the disk is full");
        },
        clock);
    const auto pause = clock.wait_for_sleeper();
    ASSERT_TRUE(pause);
    clock.advance(*pause);
    ASSERT_TRUE(clock.wait_for_sleeper());
    EXPECT_EQ(saves, 2);
  }
  EXPECT_EQ(saves, 2);
}

}  // namespace
}  // namespace stillmap::server
