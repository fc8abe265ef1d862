#include "core/odometry/motion_classification.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/odometry/box_world.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

using test::BoxScan;
using test::BoxWorld;
using test::car_size_m;

struct Classified {
  BoxScan seen;
  ObjectClusters objects;
  std::vector<MotionClass> motion_classes;

  /// The one class of all points that `chosen` picks by their position in the lidar frame.
  template <typename Predicate>
  [[nodiscard]] MotionClass class_where(Predicate chosen) const {
    std::vector<int> votes(3, 0);
    for (std::size_t i = 0; i < seen.scan.size(); ++i)
      if (objects.of_point[i] != ObjectClusters::none && chosen(seen.scan.points_lidar[i]))
        ++votes[static_cast<std::size_t>(
            motion_classes[static_cast<std::size_t>(objects.of_point[i])])];
    return static_cast<MotionClass>(std::ranges::max_element(votes) - votes.begin());
  }
};

/// The last of `scans` scans at 10 Hz from a lidar that drives along x.
Classified classify_last(const BoxWorld& world, int scans, double lidar_speed_m_s = 0.0) {
  const SensorModel sensor = test::test_lidar();
  const MotionConfig config;
  RangeImageHistory history(config);
  Classified last;
  for (int k = 0; k < scans; ++k) {
    const double time_s = 0.1 * k;
    const Eigen::Isometry3d T = test::level_pose(lidar_speed_m_s * time_s, 0.0, 0.0);
    last.seen = world.scan(sensor, T, time_s);
    const Scan& scan = last.seen.scan;
    last.objects = cluster_objects(scan.points_lidar, scan.labels, config.object_gap_m);
    RangeImageView now(scan, scan.labels, sensor, T);
    last.motion_classes = classify_motion(scan, last.objects, T, history, now, config);
    history.add(std::move(now));
  }
  return last;
}

bool anywhere(const Eigen::Vector3f& /*p_lidar*/) { return true; }

TEST(ClassifyMotion, ParkedCarIsParkedOnceThePastIsFull) {
  BoxWorld world = test::street();
  for (const double speed_m_s : {0.0, 8.0}) {
    const Classified classified = classify_last(world, 9, speed_m_s);
    const auto near_left_or_right = [](const Eigen::Vector3f& p) { return p.norm() < 12.0F; };
    EXPECT_EQ(classified.class_where(near_left_or_right), MotionClass::parked) << speed_m_s;
    EXPECT_EQ(classify_last(world, 5, speed_m_s).class_where(anywhere), MotionClass::undecided);
  }
}

TEST(ClassifyMotion, FirstScansDecideNothing) {
  BoxWorld world = test::street();
  world.stand(10.0, 0.0, car_size_m, SemanticClass::car, {8.0, 0.0, 0.0});
  for (const int scans : {1, 2})
    for (const MotionClass motion_class : classify_last(world, scans).motion_classes)
      EXPECT_EQ(motion_class, MotionClass::undecided);
}

struct MovingCase {
  const char* what;
  double x, y;
  Eigen::Vector3d velocity_map;
  double lidar_speed_m_s;
};

TEST(ClassifyMotion, MovingCarIsMovingWhicheverWayItGoes) {
  const MovingCase cases[] = {
      {"crosses", 12.0, -4.0, {0.0, 5.0, 0.0}, 0.0},
      {"comes towards", 25.0, 2.5, {-8.0, 0.0, 0.0}, 0.0},
      {"comes towards a lidar that drives", 35.0, 2.5, {-8.0, 0.0, 0.0}, 8.0},
      {"drives away", 8.0, 0.0, {8.0, 0.0, 0.0}, 0.0},
      {"drives ahead as fast as the lidar", 10.0, 0.0, {8.0, 0.0, 0.0}, 8.0},
      {"overtakes", -2.0, 3.0, {15.0, 0.0, 0.0}, 8.0},
  };
  for (const MovingCase& moving : cases) {
    BoxWorld world;
    world.stand(60.0, 0.0, {1.0, 80.0, 8.0}, SemanticClass::building);
    world.stand(moving.x, moving.y, car_size_m, SemanticClass::car, moving.velocity_map);
    const Classified classified = classify_last(world, 10, moving.lidar_speed_m_s);
    ASSERT_GE(classified.objects.count, 1U) << moving.what;
    EXPECT_EQ(classified.class_where(anywhere), MotionClass::moving) << moving.what;
  }
}

/// One car's side at y = 5 and one road point, with a local map of `map_label` at the car.
struct SplitCase {
  Scan scan;
  PointLabels labels;
  LocalMap map{LocalMapConfig{}};

  explicit SplitCase(SemanticClass map_label) {
    std::vector<LabelledPoint> map_points;
    for (int k = 0; k < 200; ++k) {
      const Eigen::Vector3f p(0.2F * static_cast<float>(k % 20), 5.0F,
                              0.2F * static_cast<float>(k / 20));
      add(p, SemanticClass::car);
      map_points.push_back({p + Eigen::Vector3f(0.0F, 0.1F, 0.0F), map_label});
    }
    add({5.0F, 0.0F, -1.7F}, SemanticClass::road);
    map.planes.insert(map_points);
  }
  void add(const Eigen::Vector3f& p, SemanticClass label) {
    scan.points_lidar.push_back(p);
    labels.classes.push_back(label);
    labels.confidence.push_back(1.0F);
  }
  /// Motion of the car's points; the road's must be stationary.
  [[nodiscard]] Motion car_motion(MotionClass motion_class,
                                  bool use_range_image_history = true) const {
    OdometryConfig config;
    config.motion.use_range_image_history = use_range_image_history;
    const ObjectClusters objects = cluster_objects(scan.points_lidar, labels.classes, 0.5);
    EXPECT_EQ(objects.count, 1U);
    const auto motion =
        classify_point_motion(scan, labels, objects, std::vector<MotionClass>{motion_class},
                              Eigen::Isometry3d::Identity(), map, config);
    EXPECT_EQ(motion.size(), scan.size());
    EXPECT_EQ(motion.back(), Motion::stationary);
    for (std::size_t i = 0; i + 1 < motion.size(); ++i) EXPECT_EQ(motion[i], motion[0]);
    return motion[0];
  }
};

TEST(ClassifyPointMotion, VerdictDecidesWhereThereIsOne) {
  const SplitCase on_road(SemanticClass::road);
  const SplitCase on_car(SemanticClass::car);
  for (const SplitCase* scene : {&on_road, &on_car}) {
    EXPECT_EQ(scene->car_motion(MotionClass::moving), Motion::highly_dynamic);
    EXPECT_EQ(scene->car_motion(MotionClass::parked), Motion::semi_static);
  }
}

TEST(ClassifyPointMotion, UndecidedObjectIsSemiStatic) {
  EXPECT_EQ(SplitCase(SemanticClass::road).car_motion(MotionClass::undecided), Motion::semi_static);
}

TEST(ClassifyPointMotion, WithoutPastViewsTheMapDecides) {
  const auto motion_beside = [](SemanticClass map_label) {
    return SplitCase(map_label).car_motion(MotionClass::undecided, false);
  };
  EXPECT_EQ(motion_beside(SemanticClass::road), Motion::highly_dynamic);
  EXPECT_EQ(motion_beside(SemanticClass::car), Motion::semi_static);
  EXPECT_EQ(motion_beside(SemanticClass::unlabeled), Motion::semi_static);
}

TEST(ClassifyPointMotion, WithoutLabelsAllIsStationary) {
  SplitCase scene(SemanticClass::road);
  scene.labels = {};
  const ObjectClusters objects = cluster_objects(scene.scan.points_lidar, {}, 0.5);
  for (const Motion motion :
       classify_point_motion(scene.scan, scene.labels, objects, {}, Eigen::Isometry3d::Identity(),
                             scene.map, OdometryConfig{}))
    EXPECT_EQ(motion, Motion::stationary);
}

}  // namespace
}  // namespace stillmap
