#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "idl/conversions/point_field.hpp"
#include "idl/conversions/to_cloud.hpp"

// What RViz2 needs of a cloud to show it in the colours of its classes.

namespace stillmap::wire {
namespace {

using sensor_msgs::msg::PointCloud2;

/// Red, green and blue of a point, as RViz2's RGB8 finds them.
Rgb shown_colour(const PointCloud2& cloud, std::size_t point) {
  const auto rgb =
      std::ranges::find_if(cloud.fields(), [](const auto& field) { return field.name() == "rgb"; });
  EXPECT_EQ(rgb->datatype(), static_cast<std::uint8_t>(FieldType::float32));
  EXPECT_EQ(rgb->offset() % 4, 0U);
  std::uint32_t packed = 0;
  std::memcpy(&packed, cloud.data().data() + point * cloud.point_step() + rgb->offset(), 4);
  return {.r = static_cast<std::uint8_t>(packed >> 16U),
          .g = static_cast<std::uint8_t>(packed >> 8U),
          .b = static_cast<std::uint8_t>(packed)};
}

TEST(CloudColour, OfAScanIsThatOfEachPointsClass) {
  LabelledScan labelled;
  labelled.scan.points_lidar.assign(3, Eigen::Vector3f::Ones());
  labelled.labels = {.classes = {SemanticClass::car, SemanticClass::unlabeled, SemanticClass::road},
                     .confidence = {1.0F, 0.0F, 1.0F}};
  labelled.motion.assign(3, Motion::stationary);
  const PointCloud2 cloud = to_cloud(labelled, "lidar");
  EXPECT_EQ(shown_colour(cloud, 0), colour(SemanticClass::car));
  EXPECT_EQ(shown_colour(cloud, 2), colour(SemanticClass::road));
  // Not black: that cannot be seen on RViz2's background.
  EXPECT_GT(shown_colour(cloud, 1).g, 100);
  EXPECT_EQ(cloud.point_step() % 4, 0U);
  EXPECT_EQ(cloud.data().size(), std::size_t{cloud.point_step()} * 3);
  EXPECT_TRUE(cloud.is_dense());
}

TEST(CloudColour, OfTheMapIsThatOfEachVoxelsClass) {
  Voxel voxel{.index = {}, .point_count = 3, .mean_map = {0.1F, 0.05F, 0.15F}, .evidence = {}};
  voxel.evidence.add(SemanticClass::vegetation, 1.0F);
  Tile tile;
  tile.voxels = PackedVoxels({}, {0.2, 20.0}, {&voxel, 1});
  tile.info.bounds_map.extend(voxel.mean_map);
  const MapSnapshot view{.version = 1, .tiles = {std::make_shared<const Tile>(tile)}};
  const Eigen::AlignedBox2f window(Eigen::Vector2f(-10.0F, -10.0F), Eigen::Vector2f(10.0F, 10.0F));
  const PointCloud2 cloud = to_cloud(view, window, 5, "map");
  EXPECT_EQ(shown_colour(cloud, 0), colour(SemanticClass::vegetation));
  EXPECT_EQ(cloud.point_step() % 4, 0U);
}

}  // namespace
}  // namespace stillmap::wire
