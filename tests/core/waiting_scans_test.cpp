#include "core/waiting_scans.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stillmap {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

WaitingScans<int> scans_along(int count, double step_m, std::size_t points) {
  WaitingScans<int> waiting;
  for (int k = 0; k < count; ++k) waiting.add(k, {step_m * k, 0.0, 0.0}, points);
  return waiting;
}

TEST(WaitingScans, EnterWithTheScanThatShowsWhereTheyAre) {
  auto waiting = scans_along(3, 1.0, 100);
  EXPECT_THAT(waiting.decided_by(MapEntry::waits), IsEmpty());
  EXPECT_THAT(waiting.decided_by(MapEntry::stays_out), IsEmpty());
  EXPECT_THAT(waiting.decided_by(MapEntry::enters_with_waiting), ElementsAre(0, 1, 2));
  EXPECT_TRUE(waiting.empty());
}

TEST(WaitingScans, AreGoneWhereNobodyKnowsWhereTheyAre) {
  for (const MapEntry entry : {MapEntry::enters, MapEntry::stays_out_with_waiting}) {
    auto waiting = scans_along(3, 1.0, 100);
    EXPECT_THAT(waiting.decided_by(entry), IsEmpty());
    EXPECT_THAT(waiting.decided_by(MapEntry::enters_with_waiting), IsEmpty());
  }
}

TEST(WaitingScans, OfALidarThatStandsAreFew) {
  EXPECT_EQ(scans_along(1000, 0.0, 100).size(), 1U);
  EXPECT_EQ(scans_along(1000, 0.01, 100).size(), 20U);
}

TEST(WaitingScans, AreSpreadAlongAWayThatIsTooLongForAll) {
  constexpr std::size_t points = 100'000, most = WaitingScans<int>::max_points / points;
  for (const int count : {100, 1000, 10000}) {
    auto waiting = scans_along(count, 1.0, points);
    EXPECT_LE(waiting.size(), most);
    EXPECT_GE(waiting.size(), most / 2 - 1);
    const std::vector<int> kept = waiting.decided_by(MapEntry::enters_with_waiting);
    EXPECT_EQ(kept.front(), 0);
    const int spacing = kept[1];
    for (std::size_t i = 1; i < kept.size(); ++i) EXPECT_EQ(kept[i] - kept[i - 1], spacing);
    EXPECT_GT(kept.back(), count - spacing - 1);
  }
  auto waiting = scans_along(10000, 1.0, points);
  waiting.clear();
  waiting.add(1, {0, 0, 0}, points);
  waiting.add(2, {0.6, 0, 0}, points);
  EXPECT_EQ(waiting.size(), 2U) << "the next stretch is as dense as the first";
}

TEST(WaitingScans, ThatIsLargerThanAllTheRoomIsKeptAlone) {
  EXPECT_EQ(scans_along(3, 1.0, 2 * WaitingScans<int>::max_points).size(), 1U);
}

}  // namespace
}  // namespace stillmap
