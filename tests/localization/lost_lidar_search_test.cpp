#include "core/localization/lost_lidar_search.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <numbers>

#include "core/lidar/prepare.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/localization/yard_map.hpp"

namespace stillmap::test {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;
constexpr std::int64_t scan_ns = second_ns / 10;

OdometryResult result_of(OdometryHealth health, MapEntry entry = MapEntry::enters) {
  OdometryResult result;
  result.health = health;
  result.map_entry = entry;
  return result;
}

const OdometryResult good = result_of(OdometryHealth::good);
const OdometryResult lost = result_of(OdometryHealth::lost);

TEST(LostWatch, GivesTheMapperSomeSecondsToFindALidarThatItHasPlaced) {
  LostWatch watch;
  EXPECT_FALSE(watch.is_due(0, lost, true));
  EXPECT_FALSE(watch.is_due(2 * second_ns, lost, true));
  EXPECT_TRUE(watch.is_due(4 * second_ns, lost, true));
  EXPECT_FALSE(watch.is_due(5 * second_ns, good, true));
  EXPECT_FALSE(watch.is_due(6 * second_ns, lost, true)) << "it was found in between";
  EXPECT_FALSE(watch.is_due(second_ns, lost, true)) << "the clock was set back";
  EXPECT_TRUE(watch.is_due(5 * second_ns, lost, true));
}

TEST(LostWatch, WaitsForNothingWhereNoScanWasPlaced) {
  EXPECT_TRUE(LostWatch{}.is_due(0, lost, false));
  EXPECT_FALSE(LostWatch{}.is_due(0, good, false));
}

TEST(LostWatch, APlaceThatNothingConfirmsIsNotKnown) {
  LostWatch watch;
  const OdometryResult waits = result_of(OdometryHealth::degenerate, MapEntry::waits);
  EXPECT_FALSE(watch.is_due(0, waits, true));
  EXPECT_TRUE(watch.is_due(4 * second_ns, waits, true));
}

/// The yard, mapped until the lidar was carried off.
class LostInTheYard : public testing::Test {
 protected:
  LostInTheYard() {
    for (const StampedPose& pose : first_yard().trajectory) {
      OdometryResult result = good;
      result.T_map_lidar = pose.T_map_lidar;
      search_.update(pose.stamp_ns, result, true);
      now_ns_ = pose.stamp_ns;
    }
  }
  void update(const OdometryResult& odometry) {
    now_ns_ += scan_ns;
    search_.update(now_ns_, odometry, true);
  }
  void stay_lost() {
    for (int k = 0; k <= 31; ++k) update(lost);
  }
  /// Scans of another day from number 95 on, until the lidar is found or there were `count`.
  std::optional<GlobalLocalization::Place> follow(std::uint64_t seed, int count) {
    const simulation::Simulation tomorrow(yard(seed, 1));
    for (int k = 95; k < 95 + count; ++k) {
      Scan scan = drop_unusable_points(tomorrow.scan(k).scan, PrepareConfig{});
      scan.stamp_ns = now_ns_;
      search_.follow(scan, labels_of(scan));
      last_ = k;
      if (auto place = search_.take_place()) return place;
      update(lost);
    }
    return std::nullopt;
  }
  [[nodiscard]] Eigen::Isometry3d T_map_lidar_last() const {
    return simulation::Simulation(yard(1, 1)).scan(last_).T_map_lidar;
  }

  LostLidarSearch search_{OdometryConfig{}, yard(1, 1).sensor, Eigen::Isometry3d::Identity(),
                          [] { return first_yard().view; }};
  std::int64_t now_ns_ = 0;
  int last_ = 0;
};

TEST_F(LostInTheYard, IsFoundByScansThatAgree) {
  EXPECT_FALSE(search_.is_on());
  stay_lost();
  ASSERT_TRUE(search_.is_on());
  const auto place = follow(1, 20);
  ASSERT_TRUE(place);
  EXPECT_GE(last_, 98) << "three scans confirm the first";
  EXPECT_FALSE(search_.is_on());
  const Eigen::Isometry3d off =
      T_map_lidar_last().inverse() * place->T_map_odom * place->odometry.predict(now_ns_);
  EXPECT_LT(off.translation().norm(), 0.3);
  EXPECT_LT(Eigen::AngleAxisd(off.linear()).angle(), std::numbers::pi / 180.0);
}

TEST_F(LostInTheYard, IsNotLookedForOnceItsMapperHasFoundIt) {
  stay_lost();
  EXPECT_FALSE(follow(1, 2));
  EXPECT_TRUE(search_.is_on());
  update(good);
  EXPECT_FALSE(search_.is_on());
  EXPECT_FALSE(follow(1, 5)) << "a search begins after some seconds";
}

TEST_F(LostInTheYard, IsLookedForWhereAnEarlierRunOfTheMapLed) {
  const Trajectory& path = first_yard().trajectory;
  const Eigen::Vector3d lost_at = path.back().T_map_lidar.translation();
  const Eigen::Vector3d carried_to = path.at(95 / 4).T_map_lidar.translation();
  ASSERT_GT((carried_to - lost_at).norm(), 20.0) << "else it is found beside where it was lost";
  search_ = LostLidarSearch(OdometryConfig{}, yard(1, 1).sensor, Eigen::Isometry3d::Identity(),
                            [] { return first_yard().view; });
  search_.add_path(path);
  OdometryResult there = good;
  there.T_map_lidar = path.back().T_map_lidar;
  update(there);
  stay_lost();
  EXPECT_TRUE(follow(1, 8));
}

// A map that goes on would be in memory twice, as it was then and as it is.
TEST(LostLidarSearch, LetsTheMapGoThatItLookedInSomeSecondsAfterItWasFound) {
  std::weak_ptr<const MapSnapshot> looked_in;
  LostLidarSearch search(OdometryConfig{}, yard(1, 1).sensor, Eigen::Isometry3d::Identity(), [&] {
    const auto view = std::make_shared<const MapSnapshot>(*first_yard().view);
    looked_in = view;
    return view;
  });
  search.update(100 * second_ns, good, true);
  search.update(101 * second_ns, lost, true);
  search.update(105 * second_ns, lost, true);
  ASSERT_TRUE(search.is_on());
  search.update(106 * second_ns, good, true);
  EXPECT_FALSE(looked_in.expired()) << "it may soon be lost again";
  search.update(116 * second_ns, good, true);
  EXPECT_TRUE(looked_in.expired());
}

TEST_F(LostInTheYard, IsNotFoundInAnotherCity) {
  stay_lost();
  EXPECT_FALSE(follow(2, 6));
  EXPECT_TRUE(search_.is_on());
}

}  // namespace
}  // namespace stillmap::test
