#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>

#include "core/dataset/scan_dataset.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/odometry/poses.hpp"
#include "tests/server/room_scans.hpp"

namespace stillmap {
namespace {

Mapper geometric_mapper() {
  MapperConfig config;
  config.sensor = hdl_64e();
  return {config, std::make_unique<NullSegmenter>()};
}

Scan scan_of(const ScanDataset& sequence, std::size_t k) {
  Scan scan = sequence.read(k).scan;
  scan.stamp_ns = sequence.stamp_ns(k);
  return scan;
}

/// A real street (KITTI raw, drive 0005): every second scan makes the map, the ones between have to
/// find their place in it, without any class to help.
TEST(ResumedMap, ScansThatAreNotInItFindTheirPlace) {
  const char* recordings = std::getenv("STILLMAP_TEST_DATA");
  if (recordings == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA names no folder of recordings";
  const auto folder = std::filesystem::path(recordings) / "kitti_raw_0005";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const ScanDataset sequence{folder};
  Mapper maker = geometric_mapper();
  Mapper follower = geometric_mapper();
  std::vector<Eigen::Isometry3d> T_map_lidar;
  for (std::size_t k = 0; k < sequence.size(); ++k) {
    if (k % 2 == 0) (void)maker.process(scan_of(sequence, k));
    T_map_lidar.push_back(follower.process(scan_of(sequence, k)).value().odometry.T_map_lidar);
  }
  int found = 0;
  int tried = 0;
  for (std::size_t k = 5; k < sequence.size(); k += 20) {
    for (const auto& guess : {test::level_pose(0.5, 0.3, 0.05), test::level_pose(3.0, -2.0, 0.4),
                              test::level_pose(-5.0, 2.0, -2.0)}) {
      Mapper mapper = geometric_mapper();
      mapper.resume(*maker.map_snapshot());
      const auto began = std::chrono::steady_clock::now();
      const auto mapped = mapper.process(scan_of(sequence, k), T_map_lidar[k] * guess);
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
      const Eigen::Isometry3d& T = mapped.value().odometry.T_map_lidar;
      const double off_m = test::translation_error(T, T_map_lidar[k]);
      const bool is_found = mapped->odometry.health == OdometryHealth::good && off_m < 0.3;
      EXPECT_TRUE(is_found || mapped->odometry.health == OdometryHealth::lost)
          << "scan " << k << " is " << off_m << " m off";
      found += is_found ? 1 : 0;
      ++tried;
      std::cout << k << ": " << name(mapped->odometry.health) << ", " << off_m << " m, "
                << test::rotation_error(T, T_map_lidar[k]) << " rad, " << took.count() << " s\n";
    }
  }
  EXPECT_GE(found, tried * 9 / 10) << "of " << tried;
}

/// A hall by 16 rings.
MapperConfig in_hall() {
  MapperConfig config;
  config.sensor = vlp_16();
  return config;
}

struct MadeMap {
  std::shared_ptr<const MapSnapshot> view;
  Eigen::Isometry3d T_map_hall;
};

/// Of the first 20 scans.
MadeMap map_of_hall() {
  Mapper maker(in_hall(), std::make_unique<NullSegmenter>());
  Eigen::Isometry3d T_map_hall = Eigen::Isometry3d::Identity();
  for (int k = 0; k < 20; ++k) {
    const auto mapped = maker.process(test::room_scan(k)).value();
    T_map_hall = mapped.odometry.T_map_lidar * test::room_pose(k).T_map_lidar.inverse();
  }
  return {maker.map_snapshot(), T_map_hall};
}

// A robot that was off the map it had loaded, was lost, and is found in it.
TEST(ResumedMap, ARelocatedLidarIsLookedForInItAlsoWhereItWasHeldBack) {
  const MadeMap made = map_of_hall();
  Mapper mapper(in_hall(), std::make_unique<NullSegmenter>());
  mapper.resume(*made.view);
  ASSERT_TRUE(
      mapper.process(test::room_scan(20), made.T_map_hall * test::room_pose(20).T_map_lidar));
  mapper.hold_resumed_map(true);
  mapper.relocate(Odometry(in_hall().odometry, vlp_16()));
  const Eigen::Isometry3d T_map_lidar = made.T_map_hall * test::room_pose(60).T_map_lidar;
  const auto found =
      mapper.process(test::room_scan(60), T_map_lidar * test::level_pose(0.8, 0.5, 0.03));
  ASSERT_TRUE(found);
  EXPECT_LT(test::translation_error(found->odometry.T_map_lidar, T_map_lidar), 0.15);
}

// What uses the pose would take it for one that is off by 1 m.
TEST(ResumedMap, OfAPoseThatDoesNotFitItNothingIsKnown) {
  const MadeMap made = map_of_hall();
  Mapper mapper(in_hall(), std::make_unique<NullSegmenter>());
  mapper.resume(*made.view);
  Scan elsewhere = test::room_scan(20);
  for (Eigen::Vector3f& p : elsewhere.points_lidar) p.head<2>() *= 2.5F;
  const auto mapped =
      mapper.process(std::move(elsewhere), made.T_map_hall * test::room_pose(20).T_map_lidar);
  ASSERT_TRUE(mapped);
  ASSERT_EQ(mapped->odometry.health, OdometryHealth::lost);
  EXPECT_GT(mapped->odometry.covariance(0, 0), 1e5);
  EXPECT_GT(mapped->odometry.covariance(5, 5), 1.0);
}

TEST(ResumedMap, OfAPlaceThatIsNotConfirmedNothingIsKnownUntilItIs) {
  const MadeMap made = map_of_hall();
  Mapper mapper(in_hall(), std::make_unique<NullSegmenter>());
  mapper.resume(*made.view);
  mapper.relocate(Odometry(in_hall().odometry, vlp_16()), 3);
  for (int k = 20; k < 25; ++k) {
    const auto prior =
        k == 20 ? std::optional(made.T_map_hall * test::room_pose(k).T_map_lidar) : std::nullopt;
    const auto mapped = mapper.process(test::room_scan(k), prior);
    ASSERT_TRUE(mapped);
    const bool is_confirmed = k >= 22;
    EXPECT_EQ(mapped->odometry.health,
              is_confirmed ? OdometryHealth::good : OdometryHealth::degenerate)
        << k;
    EXPECT_EQ(mapped->odometry.covariance(0, 0) > 1e5, !is_confirmed) << k;
  }
}

std::vector<Eigen::Isometry3d> poses_of(Mapper& mapper, const Eigen::Isometry3d& T_map_hall) {
  std::vector<Eigen::Isometry3d> T_map_lidar;
  for (int k = 20; k < 26; ++k) {
    const auto prior =
        k == 20 ? std::optional(T_map_hall * test::room_pose(k).T_map_lidar) : std::nullopt;
    const auto mapped = mapper.process(test::room_scan(k), prior);
    EXPECT_TRUE(mapped);
    if (mapped) T_map_lidar.push_back(mapped->odometry.T_map_lidar);
  }
  return T_map_lidar;
}

bool are_same(const std::vector<Eigen::Isometry3d>& a, const std::vector<Eigen::Isometry3d>& b) {
  return std::ranges::equal(a, b,
                            [](const auto& x, const auto& y) { return x.matrix() == y.matrix(); });
}

// What was prepared beside mapping is what the first scan would have had to prepare itself, where
// the lidar is and where it is not.
TEST(ResumedMap, APreparedBeginningChangesNoPose) {
  const MadeMap made = map_of_hall();
  const Eigen::Vector3d expected_map =
      (made.T_map_hall * test::room_pose(20).T_map_lidar).translation();
  Mapper unprepared(in_hall(), std::make_unique<NullSegmenter>());
  unprepared.resume(*made.view);
  const auto poses = poses_of(unprepared, made.T_map_hall);
  ASSERT_EQ(poses.size(), 6U);
  for (const double off_m : {0.0, 100.0}) {
    StaticMap map(in_hall().static_map);
    map.resume(*made.view, {});
    ResumedMap prepared =
        ResumedMap::of(std::move(map), expected_map + Eigen::Vector3d(off_m, 0.0, 0.0), in_hall());
    Mapper mapper(in_hall(), std::make_unique<NullSegmenter>());
    static_cast<void>(mapper.resume(std::move(prepared)));
    EXPECT_TRUE(are_same(poses_of(mapper, made.T_map_hall), poses)) << off_m << " m off";
  }
}

TEST(ResumedMap, IsNotBegunByALidarThatWasFoundInTheMapOfThisRun) {
  Mapper mapper(in_hall(), std::make_unique<NullSegmenter>());
  EXPECT_TRUE(mapper.begins_map());
  ASSERT_TRUE(mapper.process(test::room_scan(20)));
  EXPECT_FALSE(mapper.begins_map());
  mapper.relocate(Odometry(in_hall().odometry, vlp_16()), 3);
  EXPECT_FALSE(mapper.begins_map());
  mapper.reset(7);
  EXPECT_TRUE(mapper.begins_map());
}

/// 12 m/s, and turning.
simulation::SimulationConfig fast_drive() {
  simulation::SimulationConfig config;
  config.sensor = vlp_16();
  config.scans = 40;
  config.rolling = true;
  config.motion = simulation::LidarMotion::hard_turns;
  return config;
}

// One that is taken to have stood is bent by more than a metre, and found nowhere. The robot then
// leaves what is known behind.
TEST(ResumedMap, ALidarThatGoesOnFastIsFoundAtOnce) {
  const simulation::Simulation drive(fast_drive());
  MapperConfig config;
  config.sensor = vlp_16();
  Mapper uninterrupted(config, std::make_unique<NullSegmenter>());
  constexpr int stopped_at = 30;
  for (int k = 0; k < stopped_at; ++k) ASSERT_TRUE(uninterrupted.process(drive.scan(k).scan));
  Mapper mapper(config, std::make_unique<NullSegmenter>());
  mapper.resume(*uninterrupted.map_snapshot());
  const StampedPose last = uninterrupted.trajectory().back();
  mapper.go_on_from(uninterrupted.trajectory()[stopped_at - 2], last);
  for (int k = stopped_at; k < fast_drive().scans; ++k) {
    const auto expected = uninterrupted.process(drive.scan(k).scan);
    const auto prior = k == stopped_at ? std::optional(last.T_map_lidar) : std::nullopt;
    const auto mapped = mapper.process(drive.scan(k).scan, prior);
    ASSERT_TRUE(expected && mapped);
    EXPECT_EQ(mapped->odometry.health, OdometryHealth::good) << k;
    EXPECT_LT(test::translation_error(mapped->odometry.T_map_lidar, expected->odometry.T_map_lidar),
              0.05)
        << k;
  }
}

}  // namespace
}  // namespace stillmap
