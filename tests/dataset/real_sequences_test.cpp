// What the readers make of real recordings. The folder is named by STILLMAP_TEST_DATA.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <set>

#include "core/dataset/scan_dataset.hpp"
#include "core/lidar/range_image.hpp"
#include "core/lidar/rings.hpp"

namespace stillmap {
namespace {

class RealSequences : public testing::Test {
 protected:
  void SetUp() override {
    const char* folder = std::getenv("STILLMAP_TEST_DATA");
    if (folder == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA names no folder of recordings";
    folder_ = folder;
  }

  /// Opens one recording, or skips when this folder does not have it.
  [[nodiscard]] std::filesystem::path recording(const char* name) const { return folder_ / name; }

 private:
  std::filesystem::path folder_;
};

double elevation_deg(const Eigen::Vector3f& p) {
  return std::atan2(p.z(), std::hypot(p.x(), p.y())) * 180.0 / std::numbers::pi;
}

/// Median elevation of each ring with enough points, from the first ring down.
std::vector<double> median_elevations(const Scan& scan, const std::vector<std::uint16_t>& rings) {
  std::vector<std::vector<double>> by_ring(64);
  for (std::size_t i = 0; i < rings.size(); ++i) {
    by_ring.at(rings[i]).push_back(elevation_deg(scan.points_lidar[i]));
  }
  std::vector<double> medians;
  for (auto& elevations : by_ring) {
    if (elevations.size() < 100) continue;
    std::ranges::nth_element(elevations, elevations.begin() + std::ssize(elevations) / 2);
    medians.push_back(elevations[elevations.size() / 2]);
  }
  return medians;
}

TEST_F(RealSequences, KittiScansHave64RingsEachBelowTheOther) {
  const auto folder = recording("kitti_odom_00");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const ScanDataset dataset(folder);
  EXPECT_EQ(dataset.size(), 16U);
  const SensorModel sensor = dataset.suggested_sensor();
  for (std::size_t i = 0; i < dataset.size(); ++i) {
    const Scan scan = dataset.read(i).scan;
    const auto medians = median_elevations(scan, assign_rings(scan, sensor));
    ASSERT_EQ(medians.size(), 64U) << dataset.file(i);
    for (std::size_t ring = 1; ring < medians.size(); ++ring) {
      EXPECT_LT(medians[ring], medians[ring - 1] - 0.15) << dataset.file(i) << " ring " << ring;
    }
    EXPECT_NEAR(medians.front(), 2.8, 0.3);
    EXPECT_NEAR(medians.back(), -23.4, 0.4);
  }
}

TEST_F(RealSequences, KittiTruthAndLabelsAreRead) {
  const auto folder = recording("kitti_odom_00");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const ScanDataset dataset(folder);
  const auto truth = dataset.truth();
  ASSERT_TRUE(truth.has_value());
  // Driving forward: x in the lidar frame (z in the camera's).
  const Eigen::Vector3d way = truth->back().T_map_lidar.translation();
  EXPECT_GT(way.x(), 10.0);
  EXPECT_LT(std::abs(way.y()), 1.0);
  EXPECT_EQ(dataset.stamp_ns(1), 103'735'900);

  EXPECT_TRUE(dataset.has_labels(0));
  EXPECT_FALSE(dataset.has_labels(1));
  const DatasetFrame frame = dataset.read(0);
  ASSERT_EQ(frame.scan.labels.size(), frame.scan.size());
  const auto road = std::ranges::count(frame.scan.labels, SemanticClass::road);
  EXPECT_GT(road, std::ssize(frame.scan.labels) / 10);
  EXPECT_LT(road, std::ssize(frame.scan.labels) / 2);
}

TEST_F(RealSequences, Vlp16ScansHaveTheirRingsAndTimes) {
  const auto folder = recording("vlp16");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const ScanDataset dataset(folder);
  ASSERT_EQ(dataset.size(), 99U);
  EXPECT_EQ(dataset.suggested_sensor().name, "VLP-16");
  EXPECT_EQ(dataset.stamp_ns(0), 1'539'765'924'815'966'000);
  for (std::size_t i = 1; i < dataset.size(); ++i) {
    EXPECT_NEAR(static_cast<double>(dataset.stamp_ns(i) - dataset.stamp_ns(i - 1)), 0.101e9, 5e6);
  }
  const Scan scan = dataset.read(7).scan;
  const auto rings = assign_rings(scan, vlp_16());
  for (std::size_t i = 0; i < scan.size(); ++i) {
    ASSERT_NEAR(elevation_deg(scan.points_lidar[i]), 15.0 - 2.0 * rings[i], 0.1);
  }
  EXPECT_LE(*std::ranges::max_element(scan.intensity), 1.0F);
  EXPECT_GT(*std::ranges::max_element(scan.intensity), 0.2F);
}

TEST_F(RealSequences, Vlp16PointsKeepTheirRowInTheRangeImage) {
  const auto folder = recording("vlp16");
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is absent";
  const Scan scan = ScanDataset(folder).read(0).scan;
  const auto rings = assign_rings(scan, vlp_16());
  const RangeImage image(scan.points_lidar, projection_model(vlp_16()));
  ASSERT_GT(scan.size(), 1000U);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    ASSERT_EQ(image.pixel_of_point()[i] / image.columns(), rings[i]);
  }
}

}  // namespace
}  // namespace stillmap
