#include "core/evaluation/drive_mutation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

namespace stillmap::evaluation {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr std::int64_t period_ns = 100'000'000;

std::vector<std::int64_t> stamps(std::size_t scans) {
  std::vector<std::int64_t> stamps_ns;
  for (std::size_t i = 0; i < scans; ++i)
    stamps_ns.push_back(static_cast<std::int64_t>(i) * period_ns);
  return stamps_ns;
}

std::vector<MutatedScan> mutated(const std::string& name, std::size_t scans,
                                 std::size_t other_scans = 0) {
  return mutate_drive(drive_mutation(name), stamps(scans), other_scans);
}

std::vector<std::size_t> indices(const std::vector<MutatedScan>& scans) {
  std::vector<std::size_t> found;
  for (const MutatedScan& scan : scans) found.push_back(scan.index);
  return found;
}

bool stamps_grow(const std::vector<MutatedScan>& scans) {
  return std::ranges::is_sorted(scans, std::ranges::less_equal(), &MutatedScan::stamp_ns);
}

TEST(DriveMutations, AreKnownByName) {
  EXPECT_EQ(drive_mutation("cover_all"), DriveMutation::cover_all);
  try {
    (void)drive_mutation("flood");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("'flood'"), HasSubstr("teleport")));
  }
}

TEST(DriveMutations, LeaveTheDriveAsItIsWithoutOne) {
  const auto scans = mutated("none", 5);
  EXPECT_THAT(indices(scans), ElementsAre(0, 1, 2, 3, 4));
  EXPECT_EQ(scans[3].stamp_ns, 3 * period_ns);
}

TEST(DriveMutations, DropOneSecondAndThree) {
  const auto scans = mutated("drop", 90);
  EXPECT_EQ(scans.size(), 50U);
  const std::vector<std::size_t> left = indices(scans);
  EXPECT_EQ(left[29], 29U);
  EXPECT_EQ(left[30], 40U);
  EXPECT_EQ(left.back(), 59U);
  EXPECT_EQ(scans[30].stamp_ns, 40 * period_ns);
}

TEST(DriveMutations, CarryTheLidarOffAndBackUnderEvenStamps) {
  const auto scans = mutated("teleport", 8);
  EXPECT_THAT(indices(scans), ElementsAre(0, 1, 2, 3, 6, 7, 2, 3));
  for (std::size_t k = 0; k < scans.size(); ++k)
    EXPECT_EQ(scans[k].stamp_ns, static_cast<std::int64_t>(k) * period_ns);
}

TEST(DriveMutations, VisitAnotherPlaceWhileTheDriveGoesOn) {
  const auto scans = mutated("other_place", 60, 50);
  EXPECT_EQ(std::ranges::count(scans, true, &MutatedScan::of_other_place), 20);
  EXPECT_TRUE(scans[30].of_other_place);
  EXPECT_EQ(scans[31].index, 1U);
  EXPECT_EQ(scans[50].index, 50U);
  EXPECT_EQ(std::ranges::count(mutated("other_place", 60, 10), true, &MutatedScan::of_other_place),
            10);
}

TEST(DriveMutations, CoverTheMiddleThird) {
  const auto scans = mutated("cover", 9);
  for (std::size_t i = 0; i < scans.size(); ++i)
    EXPECT_EQ(scans[i].visible_to_deg < 180.0, i >= 3 && i < 6) << i;
}

TEST(DriveMutations, MoveStampsButNotTheirOrder) {
  const auto jittered = mutated("jitter", 200);
  EXPECT_TRUE(stamps_grow(jittered));
  std::int64_t largest_ns = 0;
  for (std::size_t i = 0; i < jittered.size(); ++i)
    largest_ns = std::max(
        largest_ns, std::abs(jittered[i].stamp_ns - static_cast<std::int64_t>(i) * period_ns));
  EXPECT_GT(largest_ns, 35'000'000);
  EXPECT_LE(largest_ns, 45'000'000);
  const auto late = mutated("late", 40);
  EXPECT_TRUE(stamps_grow(late));
  EXPECT_EQ(late[10].stamp_ns, 10 * period_ns + 90'000'000);
  EXPECT_EQ(late[11].stamp_ns, 11 * period_ns);
}

TEST(DriveMutations, TakeShortDrives) {
  for (const char* name : {"drop", "teleport", "other_place", "cover", "jitter", "late"})
    for (std::size_t scans = 0; scans < 4; ++scans)
      EXPECT_LE(mutated(name, scans, 3).size(), scans) << name;
}

TEST(MutateScan, KeepsThePointsThatAreNotCoveredWithAllThatBelongsToThem) {
  Scan scan;
  scan.points_lidar = {{5, 0, 0}, {0, 5, 0}, {-5, -1, 0}, {0, -5, 0}};
  scan.intensity = {0.1F, 0.2F, 0.3F, 0.4F};
  scan.ring = {1, 2, 3, 4};
  scan.labels = {SemanticClass::car, SemanticClass::road, SemanticClass::car, SemanticClass::pole};
  const Scan left =
      mutate_scan(scan, {.stamp_ns = 7, .visible_from_deg = -180.0, .visible_to_deg = 0.0});
  EXPECT_EQ(left.stamp_ns, 7);
  EXPECT_THAT(left.ring, ElementsAre(1, 3, 4));
  EXPECT_THAT(left.intensity, ElementsAre(0.1F, 0.3F, 0.4F));
  EXPECT_EQ(left.labels.back(), SemanticClass::pole);
  EXPECT_TRUE(left.time_offset_s.empty());
  EXPECT_EQ(mutate_scan(scan, {}).size(), 4U);
}

}  // namespace
}  // namespace stillmap::evaluation
