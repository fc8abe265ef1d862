#include "core/segmentation/lidar_tilt.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/segmentation/model_description.hpp"
#include "core/segmentation/network_input.hpp"
#include "core/segmentation/network_segmenter.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

constexpr double degree_rad = std::numbers::pi / 180.0;

Eigen::Matrix3d about(const Eigen::Vector3d& axis, double angle_deg) {
  return Eigen::AngleAxisd(angle_deg * degree_rad, axis).toRotationMatrix();
}

const Eigen::Vector3d x_axis = Eigen::Vector3d::UnitX();
const Eigen::Vector3d y_axis = Eigen::Vector3d::UnitY();
const Eigen::Vector3d z_axis = Eigen::Vector3d::UnitZ();

ProjectionModel between(double up_deg, double down_deg) {
  return {
      .rows = 64, .columns = 64, .fov_up = up_deg * degree_rad, .fov_down = down_deg * degree_rad};
}

TEST(LidarTilt, IsWhatTurnsAwayFromUpright) {
  EXPECT_TRUE(LidarTilt().is_upright());
  EXPECT_TRUE(LidarTilt(about(z_axis, 90.0)).is_upright());
  EXPECT_FALSE(LidarTilt(about(y_axis, 3.0)).is_upright());
  EXPECT_FALSE(LidarTilt(about(y_axis, 3.0)).turns_image());
  EXPECT_TRUE(LidarTilt(about(x_axis, -15.0)).turns_image());
  EXPECT_TRUE(LidarTilt(about(x_axis, 180.0)).turns_image());
}

TEST(LidarTilt, WidensTheFieldOfViewByWhatTheLidarSees) {
  const ProjectionModel pitched = LidarTilt(about(y_axis, 15.0)).widened(between(10.0, -30.0));
  EXPECT_NEAR(pitched.fov_up, 25.0 * degree_rad, 1e-6);
  EXPECT_NEAR(pitched.fov_down, -45.0 * degree_rad, 1e-6);
  const ProjectionModel hanging = LidarTilt(about(x_axis, 180.0)).widened(between(10.0, -30.0));
  EXPECT_NEAR(hanging.fov_up, 30.0 * degree_rad, 1e-6);
  EXPECT_NEAR(hanging.fov_down, -10.0 * degree_rad, 1e-6);
  // Looks straight down by its middle.
  const ProjectionModel on_its_side = LidarTilt(about(y_axis, 90.0)).widened(between(10.0, -30.0));
  EXPECT_NEAR(on_its_side.fov_up, 90.0 * degree_rad, 1e-6);
  EXPECT_NEAR(on_its_side.fov_down, -90.0 * degree_rad, 1e-6);
  EXPECT_EQ(LidarTilt(about(y_axis, 5.0)).widened(between(10.0, -30.0)).fov_up, 10.0 * degree_rad);
}

TEST(ForSensor, GivesALeaningSensorUpToHalfAsManyRowsMore) {
  ModelDescription model = test::describe_family(64, 1024, 20);
  model.follow_sensor = true;
  const auto rows = [&](const SensorModel& sensor, const Eigen::Matrix3d& R_base_lidar) {
    return for_sensor(model, sensor, LidarTilt(R_base_lidar)).rows;
  };
  EXPECT_EQ(rows(vlp_16(), about(y_axis, 5.0)), 32);
  EXPECT_EQ(rows(vlp_16(), about(y_axis, 15.0)), 48);
  EXPECT_EQ(rows(hdl_64e(), about(x_axis, 15.0)), 96);
  EXPECT_EQ(rows(hdl_64e(), about(x_axis, 180.0)), 64);
  EXPECT_EQ(for_sensor(model, vlp_16(), LidarTilt(about(y_axis, 15.0))).fov_up, vlp_16().fov_up);
}

/// A network that looks at each pixel's own point, and a scan of a lidar that leans.
class LeaningLidar : public testing::Test {
 protected:
  LeaningLidar() {
    const test::TinyNetwork network = test::random_network(8, 32, 20);
    model_ = test::describe(network);
    model_.fov_up = 80.0 * degree_rad;
    model_.fov_down = -80.0 * degree_rad;
    model_.follow_sensor = true;
    model_.network_file = test::write_model(test::onnx_bytes(network));
  }

  /// Share of points that have the class in the leaning lidar's scan that they have in the upright
  /// one's.
  double found_alike(const Eigen::Matrix3d& R_base_lidar, const Eigen::Matrix3d& R_told) const {
    const Scan upright = test::random_scan(200, 4);
    Scan leaning = upright;
    for (Eigen::Vector3f& point : leaning.points_lidar)
      point = R_base_lidar.transpose().cast<float>() * point;
    const auto segmenter = open_model(model_);
    const PointLabels expected = segmenter->segment(upright);
    segmenter->set_mount(Eigen::Isometry3d(R_told));
    const PointLabels found = segmenter->segment(leaning);
    double alike = 0.0;
    for (std::size_t i = 0; i < upright.size(); ++i)
      alike += found.classes[i] == expected.classes[i] ? 1.0 : 0.0;
    return alike / static_cast<double>(upright.size());
  }

  ModelDescription model_;
};

TEST_F(LeaningLidar, HasTheClassesOfAnUprightOneWhereItsMountIsTold) {
  const Eigen::Matrix3d upright = Eigen::Matrix3d::Identity();
  for (const Eigen::Matrix3d& leaning :
       {about(y_axis, 4.0), about(x_axis, -20.0), about(x_axis, 180.0)}) {
    // Points that share a pixel do not in the other image.
    EXPECT_GT(found_alike(leaning, leaning), 0.75);
    EXPECT_GT(found_alike(leaning, leaning), found_alike(leaning, upright));
  }
  EXPECT_LT(found_alike(about(x_axis, 180.0), upright), 0.5);
}

TEST_F(LeaningLidar, KeepsTheImageOfItsOwnAxesWhereThatIsOfFixedSize) {
  model_.follow_sensor = false;
  model_.fov_up = 10.0 * degree_rad;
  model_.fov_down = -10.0 * degree_rad;
  Scan scan;
  // All around in its own axes, of which the turned ones leave most beyond the field of view.
  for (int azimuth = 0; azimuth < 32; ++azimuth) {
    const double a = (azimuth + 0.5) * std::numbers::pi / 16.0;
    for (int ring = 0; ring < 8; ++ring) {
      const double elevation = (8.75 - 2.5 * ring) * degree_rad;
      scan.points_lidar.push_back(
          (10.0 * Eigen::Vector3d(std::cos(a) * std::cos(elevation),
                                  std::sin(a) * std::cos(elevation), std::sin(elevation)))
              .cast<float>());
    }
  }
  const Eigen::Matrix3d R_base_lidar = about(x_axis, 60.0);
  const auto segmenter = open_model(model_);
  segmenter->set_mount(Eigen::Isometry3d(R_base_lidar));
  const RangeImage image(scan.points_lidar, model_.projection());
  const std::vector<Eigen::Vector3f> turned = LidarTilt(R_base_lidar).turned(scan.points_lidar);
  const auto opened = open_network(model_, {});
  const PixelLabels pixels =
      pixel_labels(opened.network->run(make_network_input(turned, {}, image, model_)), model_);
  const PointLabels labels = segmenter->segment(scan);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const auto pixel = static_cast<std::size_t>(image.pixel_of_point()[i]);
    EXPECT_EQ(labels.classes[i], pixels.classes[pixel]) << i;
  }
}

TEST_F(LeaningLidar, AtAnotherHeightHasItsPointsMovedToTheModels) {
  const Scan scan = test::random_scan(200, 4);
  const auto classes_at = [&](double height_m) {
    const auto segmenter = open_model(model_);
    segmenter->set_mount(Eigen::Isometry3d(Eigen::Translation3d(0.2, 0.0, height_m)));
    return segmenter->segment(scan).classes;
  };
  const auto unmoved = open_model(model_)->segment(scan).classes;
  EXPECT_EQ(classes_at(0.5), unmoved);
  model_.lidar_height_m = 8.5;
  EXPECT_EQ(classes_at(0.0), unmoved);
  EXPECT_EQ(classes_at(50.0), unmoved);
  const auto moved = classes_at(0.5);
  EXPECT_NE(moved, unmoved);
  model_.lidar_height_m.reset();
  model_.statistics.mean[index(InputChannel::z)] += 8.0F;
  EXPECT_EQ(moved, open_model(model_)->segment(scan).classes);
}

TEST_F(LeaningLidar, IsNoOneThatOnlyLooksAnotherWay) {
  const Scan scan = test::random_scan(200, 4);
  const auto segmenter = open_model(model_);
  const PointLabels expected = segmenter->segment(scan);
  segmenter->set_mount(
      Eigen::Isometry3d(Eigen::Translation3d(0.2, 0.0, 0.8) * Eigen::AngleAxisd(1.2, z_axis)));
  EXPECT_EQ(segmenter->segment(scan).classes, expected.classes);
}

}  // namespace
}  // namespace stillmap
