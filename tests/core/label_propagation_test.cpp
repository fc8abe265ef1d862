// How right labels are that were propagated from the map and an earlier scan, in a simulated city.
#include "core/map/label_propagation.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "core/lidar/prepare.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap {
namespace {

constexpr int scans = 40;

const std::vector<simulation::SimulatedScan>& crowded_sequence() {
  static const std::vector<simulation::SimulatedScan> sequence = [] {
    simulation::SimulationConfig config;
    config.plan = simulation::crowded_avenue();
    config.seed = 4;
    config.sensor = hdl_32e();
    config.scans = scans;
    const simulation::Simulation simulation(config);
    std::vector<simulation::SimulatedScan> all;
    for (int k = 0; k < scans; ++k) all.push_back(simulation.scan(k));
    return all;
  }();
  return sequence;
}

PointLabels true_labels(const Scan& scan) {
  return {.classes = scan.labels, .confidence = std::vector<float>(scan.size(), 1.0F)};
}

/// Movable things as evidence only, all else as what it is.
std::vector<Motion> true_motion(const simulation::SimulatedScan& simulated) {
  std::vector<Motion> motion;
  for (const std::uint32_t raw : simulated.raw_labels) {
    const auto id = static_cast<std::uint16_t>(raw);
    const bool moving = is_moving_semantic_kitti(id);
    const bool movable = is_movable(class_from_semantic_kitti(id));
    motion.push_back(moving    ? Motion::highly_dynamic
                     : movable ? Motion::semi_static
                               : Motion::stationary);
  }
  return motion;
}

struct Score {
  std::size_t points = 0;
  std::size_t labelled = 0;
  std::size_t right = 0;

  void add(SemanticClass truth, SemanticClass propagated) {
    ++points;
    labelled += propagated != SemanticClass::unlabeled ? 1U : 0U;
    right += propagated == truth ? 1U : 0U;
  }
  [[nodiscard]] double coverage() const {
    return static_cast<double>(labelled) / static_cast<double>(points);
  }
  [[nodiscard]] double precision() const {
    return static_cast<double>(right) / static_cast<double>(labelled);
  }
};

struct Scores {
  Score all;
  Score moving;
};

/// Maps every n-th scan with its true labels and propagates them to the scans between.
Scores propagate_through_the_city(int every) {
  StaticMap map(StaticMapConfig{});
  std::optional<LabelledRangeImage> last;
  Scores scores;
  for (int k = 0; k < scans; ++k) {
    const simulation::SimulatedScan& now = crowded_sequence()[static_cast<std::size_t>(k)];
    if (k % every == 0) {
      const PointLabels labels = true_labels(now.scan);
      map.insert({now.scan, labels, true_motion(now)}, now.T_map_lidar);
      last.emplace(now.scan, labels, now.T_map_lidar, hdl_32e());
      continue;
    }
    if (k < 10) continue;
    const PropagatedLabels propagated = propagate_labels(now.scan, now.T_map_lidar, &map, last);
    for (std::size_t i = 0; i < now.scan.size(); ++i) {
      const SemanticClass truth = now.scan.labels[i];
      if (truth == SemanticClass::unlabeled || now.scan.points_lidar[i].norm() > 50.0F) continue;
      scores.all.add(truth, propagated.labels.classes[i]);
      if (is_moving_semantic_kitti(static_cast<std::uint16_t>(now.raw_labels[i]))) {
        scores.moving.add(truth, propagated.labels.classes[i]);
      }
    }
  }
  return scores;
}

struct Expected {
  int every;
  double coverage, precision, moving_coverage, moving_precision;
};

class PropagatedLabelsInTheCity : public testing::TestWithParam<Expected> {};

TEST_P(PropagatedLabelsInTheCity, AreMostlyRight) {
  const Expected& expected = GetParam();
  const Scores scores = propagate_through_the_city(expected.every);
  RecordProperty("coverage", std::to_string(scores.all.coverage()));
  RecordProperty("precision", std::to_string(scores.all.precision()));
  RecordProperty("moving_coverage", std::to_string(scores.moving.coverage()));
  RecordProperty("moving_precision", std::to_string(scores.moving.precision()));
  ASSERT_GT(scores.moving.points, 1000U);
  EXPECT_GT(scores.all.coverage(), expected.coverage);
  EXPECT_GT(scores.all.precision(), expected.precision);
  EXPECT_GT(scores.moving.coverage(), expected.moving_coverage);
  EXPECT_GT(scores.moving.precision(), expected.moving_precision);
}

INSTANTIATE_TEST_SUITE_P(Map, PropagatedLabelsInTheCity,
                         testing::Values(Expected{2, 0.94, 0.93, 0.80, 0.88},
                                         Expected{3, 0.91, 0.92, 0.73, 0.83},
                                         Expected{5, 0.86, 0.89, 0.62, 0.72}),
                         [](const auto& info) {
                           return "Every" + std::to_string(info.param.every);
                         });

Scan one_point(const Eigen::Vector3f& point_lidar) {
  Scan scan;
  scan.points_lidar.push_back(point_lidar);
  return scan;
}

PropagatedLabels propagated_to(const Eigen::Vector3f& point, const StaticMap& map,
                               const std::optional<LabelledRangeImage>& last) {
  return propagate_labels(one_point(point), Eigen::Isometry3d::Identity(), &map, last);
}

StaticMap map_with(const Eigen::Vector3f& point, SemanticClass label) {
  StaticMap map(StaticMapConfig{});
  map.insert({one_point(point), {{label}, {0.8F}}, {Motion::stationary}},
             Eigen::Isometry3d::Identity());
  return map;
}

LabelledRangeImage view_with(const Eigen::Vector3f& point, SemanticClass label) {
  return {one_point(point), {{label}, {0.6F}}, Eigen::Isometry3d::Identity(), hdl_64e()};
}

TEST(PropagatedLabels, NothingKnownGivesNothing) {
  const PropagatedLabels propagated =
      propagated_to({10, 0, 0}, StaticMap(StaticMapConfig{}), std::nullopt);
  EXPECT_EQ(propagated.labels.classes[0], SemanticClass::unlabeled);
  EXPECT_EQ(propagated.labels.confidence[0], 0.0F);
  EXPECT_EQ(propagated.origin[0], LabelOrigin::none);
}

TEST(PropagatedLabels, TheMapsVoxelCountsBeforeAStaticNeighbour) {
  const StaticMap map = map_with({10, 0, 0}, SemanticClass::road);
  const auto last = view_with({10.05F, 0, 0}, SemanticClass::sidewalk);
  const PropagatedLabels propagated = propagated_to({10.02F, 0, 0}, map, last);
  EXPECT_EQ(propagated.labels.classes[0], SemanticClass::road);
  EXPECT_FLOAT_EQ(propagated.labels.confidence[0], 0.5F);
  EXPECT_EQ(propagated.origin[0], LabelOrigin::map);
  EXPECT_EQ(new_evidence(propagated).confidence[0], 0.0F);
}

TEST(PropagatedLabels, AMoverNextToThePointCountsBeforeTheMap) {
  const StaticMap map = map_with({10, 0, 0}, SemanticClass::road);
  const auto last = view_with({10.2F, 0, 0}, SemanticClass::car);
  const PropagatedLabels propagated = propagated_to({10.02F, 0, 0}, map, last);
  EXPECT_EQ(propagated.labels.classes[0], SemanticClass::car);
  EXPECT_FLOAT_EQ(propagated.labels.confidence[0], 0.3F);
  EXPECT_EQ(new_evidence(propagated).confidence[0], propagated.labels.confidence[0]);
}

TEST(PropagatedLabels, UnknownPlacesTakeTheNearestPointOfTheLastScanIfItIsNear) {
  const StaticMap map(StaticMapConfig{});
  const auto last = view_with({20, 1, 0}, SemanticClass::person);
  EXPECT_EQ(propagated_to({20.3F, 1.4F, 0.1F}, map, last).labels.classes[0], SemanticClass::person);
  EXPECT_EQ(propagated_to({20, 3.2F, 0}, map, last).labels.classes[0], SemanticClass::unlabeled);
  EXPECT_EQ(propagated_to({-20, -1, 0}, map, last).labels.classes[0], SemanticClass::unlabeled);
}

TEST(PropagatedLabels, EgoMotionIsTakenOut) {
  Eigen::Isometry3d T_map_now = Eigen::Isometry3d::Identity();
  T_map_now.translate(Eigen::Vector3d(5, 0, 0));
  T_map_now.rotate(Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitZ()));
  const auto last = view_with({20, 1, 0}, SemanticClass::pole);
  const Eigen::Vector3d seen_now = T_map_now.inverse() * Eigen::Vector3d(20, 1, 0);
  const StaticMap map(StaticMapConfig{});
  const PropagatedLabels propagated =
      propagate_labels(one_point(seen_now.cast<float>()), T_map_now, &map, last);
  EXPECT_EQ(propagated.labels.classes[0], SemanticClass::pole);
}

TEST(PropagatedLabels, PointsThatAreNoMeasurementsDoNoHarm) {
  const StaticMap map = map_with({10, 0, 0}, SemanticClass::road);
  const auto last = view_with({10, 0, 0}, SemanticClass::car);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  for (const Eigen::Vector3f& point : {Eigen::Vector3f(nan, 0, 0), Eigen::Vector3f(infinity, 0, 0),
                                       Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(0, 0, -1e30F)}) {
    EXPECT_EQ(propagated_to(point, map, last).origin[0], LabelOrigin::none);
  }
}

}  // namespace
}  // namespace stillmap
