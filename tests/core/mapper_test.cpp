#include "core/mapper.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "core/segmentation/segmenter.hpp"
#include "tests/odometry/box_sequence.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

using test::BoxSequence;
using test::BoxWorld;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

MapperConfig box_config() {
  MapperConfig config;
  config.sensor = test::test_lidar();
  return config;
}

Mapper box_mapper(MapperListeners listeners = {}) {
  return {box_config(), std::make_unique<PassthroughSegmenter>(), std::move(listeners)};
}

const BoxSequence& traffic_sequence() {
  static const BoxSequence sequence(test::street_with_traffic(), 30);
  return sequence;
}

TEST(MapperSequence, GivesPosesMotionAndAMapWithoutTraffic) {
  Mapper mapper = box_mapper();
  const BoxSequence& sequence = traffic_sequence();
  for (std::size_t k = 0; k < sequence.scans.size(); ++k) {
    const auto mapped = mapper.process(sequence.scans[k].scan);
    ASSERT_TRUE(mapped) << mapper.last_rejection().reason;
    test::expect_near(mapped->odometry.T_map_lidar, sequence.T_map_lidar[k], 0.2, 0.01);
    EXPECT_EQ(mapped->labelled.scan.stamp_ns, sequence.scans[k].scan.stamp_ns);
    EXPECT_EQ(mapped->labelled.motion.size(), mapped->labelled.scan.size());
    EXPECT_EQ(mapped->labelled.labels.classes.size(), mapped->labelled.scan.size());
  }
  ASSERT_EQ(mapper.trajectory().size(), sequence.scans.size());
  EXPECT_EQ(mapper.trajectory().back().stamp_ns, sequence.scans.back().scan.stamp_ns);

  const auto view = mapper.map_snapshot();
  EXPECT_GT(view->tiles.voxel_count(), 5000U);
  for (const auto& tile : view->tiles)
    for (const Voxel& voxel : tile->voxels) ASSERT_FALSE(is_movable(voxel.evidence.winner()));
}

TEST(MapperSequence, PriorReplacesThePrediction) {
  Mapper mapper = box_mapper();
  const Eigen::Isometry3d T_start = test::level_pose(3.0, 4.0, 0.5);
  const auto mapped = mapper.process(traffic_sequence().scans[0].scan, T_start);
  ASSERT_TRUE(mapped);
  test::expect_near(mapped->odometry.T_map_lidar, T_start, 1e-12, 1e-7);
}

TEST(MapperSequence, WithoutLabelsAllIsStationary) {
  Mapper mapper(box_config(), std::make_unique<NullSegmenter>());
  EXPECT_EQ(mapper.label_source(), "none");
  for (std::size_t k = 0; k < 10; ++k) {
    const auto mapped = mapper.process(traffic_sequence().scans[k].scan);
    ASSERT_TRUE(mapped);
    EXPECT_TRUE(mapped->labelled.labels.empty());
    EXPECT_THAT(mapped->labelled.motion, Each(Motion::stationary));
    test::expect_near(mapped->odometry.T_map_lidar, traffic_sequence().T_map_lidar[k], 0.2, 0.02);
  }
}

TEST(MapperSequence, StagesEndInTheOrderOfAScan) {
  std::vector<std::string> stages;
  Mapper mapper = box_mapper(
      {.stage_ended = [&](std::string_view stage) { stages.emplace_back(stage); },
       .pose_found = [&](std::int64_t, const OdometryResult&) { stages.emplace_back("pose"); }});
  ASSERT_TRUE(mapper.process(traffic_sequence().scans[0].scan));
  EXPECT_THAT(stages, ElementsAre("prepare", "segment", "odometry", "pose", "static_map"));
}

TEST(MapperSequence, PointsThatAreNoMeasurementsAreDropped) {
  Scan scan = traffic_sequence().scans[0].scan;
  const std::size_t good = scan.size();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  for (const Eigen::Vector3f& p :
       {Eigen::Vector3f(nan, 1.0F, 1.0F), Eigen::Vector3f(1.0F, infinity, 1.0F),
        Eigen::Vector3f(0.0F, 0.0F, 0.0F), Eigen::Vector3f(1e6F, 0.0F, 0.0F)}) {
    scan.points_lidar.push_back(p);
    scan.ring.push_back(0);
    scan.labels.push_back(SemanticClass::car);
  }
  Mapper mapper = box_mapper();
  const auto mapped = mapper.process(scan);
  ASSERT_TRUE(mapped);
  EXPECT_EQ(mapped->labelled.scan.size(), good);
}

TEST(MapperReset, StartsAnotherMapAtTheOrigin) {
  Mapper mapper = box_mapper();
  for (std::size_t k = 0; k < 5; ++k) ASSERT_TRUE(mapper.process(traffic_sequence().scans[k].scan));
  mapper.reset(77);
  EXPECT_TRUE(mapper.trajectory().empty());
  EXPECT_EQ(mapper.map_snapshot()->map_id, 77U);
  EXPECT_EQ(mapper.map_snapshot()->tiles.voxel_count(), 0U);
  // An earlier stamp is fine in a new map.
  const auto mapped = mapper.process(traffic_sequence().scans[0].scan);
  ASSERT_TRUE(mapped);
  EXPECT_EQ(mapped->odometry.health, OdometryHealth::initialised);
  test::expect_near(mapped->odometry.T_map_lidar, Eigen::Isometry3d::Identity(), 1e-12, 1e-7);
}

TEST(MapperResume, ExtendsAStoredMap) {
  Mapper before = box_mapper();
  for (std::size_t k = 0; k < 5; ++k) ASSERT_TRUE(before.process(traffic_sequence().scans[k].scan));
  const auto stored = before.map_snapshot();
  Mapper after = box_mapper();
  after.resume(*stored);
  EXPECT_EQ(after.map_snapshot()->tiles.voxel_count(), stored->tiles.voxel_count());
  for (std::size_t k = 0; k < 10; ++k) ASSERT_TRUE(after.process(traffic_sequence().scans[k].scan));
  EXPECT_GT(after.map_snapshot()->tiles.voxel_count(), stored->tiles.voxel_count());
}

std::shared_ptr<const MapSnapshot> stored_street() {
  static const std::shared_ptr<const MapSnapshot> stored = [] {
    Mapper mapper = box_mapper();
    for (const auto& scan : traffic_sequence().scans) (void)mapper.process(scan.scan);
    return mapper.map_snapshot();
  }();
  return stored;
}

/// Goes on in the stored street from a place that is only roughly known.
void expect_found_from(double x, double y, double yaw) {
  constexpr std::size_t first = 12;
  const BoxSequence& sequence = traffic_sequence();
  Mapper mapper = box_mapper();
  mapper.resume(*stored_street());
  const Eigen::Isometry3d T_first_guess = test::level_pose(x, y, yaw);
  for (std::size_t k = first; k < sequence.scans.size(); ++k) {
    const auto prior =
        k == first ? std::optional(sequence.T_map_lidar[first] * T_first_guess) : std::nullopt;
    const auto mapped = mapper.process(sequence.scans[k].scan, prior);
    ASSERT_TRUE(mapped) << mapper.last_rejection().reason;
    EXPECT_EQ(mapped->odometry.health, OdometryHealth::good);
    test::expect_near(mapped->odometry.T_map_lidar, sequence.T_map_lidar[k], 0.2, 0.01);
  }
}

TEST(MapperResume, FindsItsPlaceInTheStoredMap) {
  expect_found_from(0.0, 0.0, 0.0);
  expect_found_from(1.5, -1.0, 0.2);
  expect_found_from(-4.0, 3.0, 2.5);
}

TEST(MapperResume, SaysThatItIsLostWhereTheScanDoesNotFit) {
  BoxWorld yard;
  for (int k = 0; k < 12; ++k) {
    yard.stand(6.0 * (k % 4) - 9.0, 7.0 * (k / 4) - 9.0, {1.5, 0.8, 3.0}, SemanticClass::building);
  }
  Mapper mapper = box_mapper();
  mapper.resume(*stored_street());
  const Eigen::Isometry3d T_guess = test::level_pose(3.0, 0.5, 0.1);
  const auto mapped = mapper.process(yard.scan(test::test_lidar(), T_guess, 100.0).scan, T_guess);
  ASSERT_TRUE(mapped);
  EXPECT_EQ(mapped->odometry.health, OdometryHealth::lost);
  test::expect_near(mapped->odometry.T_map_lidar, T_guess, 1e-9, 1e-7);
}

TEST(MapperConfig, FaultsOfEveryPartAreThrown) {
  MapperConfig config = box_config();
  config.sensor.rings = 0;
  config.odometry.alpha = 2.0;
  config.static_map.voxel_size_m = -1.0;
  try {
    Mapper mapper(config, std::make_unique<NullSegmenter>());
    FAIL() << "accepted a bad configuration";
  } catch (const std::invalid_argument& fault) {
    EXPECT_THAT(config.faults(), HasSubstr("rings"));
    EXPECT_THAT(config.faults(), HasSubstr("alpha"));
    EXPECT_THAT(config.faults(), HasSubstr("voxel_size_m"));
    EXPECT_STREQ(fault.what(), config.faults().c_str());
  }
}

}  // namespace
}  // namespace stillmap
