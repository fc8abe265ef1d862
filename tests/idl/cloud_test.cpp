#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/conversions/to_cloud.hpp"
#include "tests/idl/cloud_fixture.hpp"

namespace stillmap::wire {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatNear;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pointwise;

Scan random_scan(std::size_t points) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> coordinate(-80.0F, 80.0F);
  std::uniform_int_distribution<int> label(0, 19);
  Scan scan;
  scan.stamp_ns = 1'234'567'890'123'456'789;
  for (std::size_t i = 0; i < points; ++i) {
    scan.points_lidar.emplace_back(coordinate(random), coordinate(random), coordinate(random));
    scan.intensity.push_back(std::abs(coordinate(random)) / 80.0F);
    scan.time_offset_s.push_back(0.1F * static_cast<float>(i) / static_cast<float>(points));
    scan.ring.push_back(static_cast<std::uint16_t>(i % 64));
    scan.labels.push_back(static_cast<SemanticClass>(label(random)));
  }
  return scan;
}

TEST(CloudToScan, GivesBackWhatScanToCloudWrote) {
  const Scan scan = random_scan(1000);
  const ScanFromCloud back = to_scan(to_cloud(scan, {}, "lidar"), {});
  ASSERT_TRUE(back.scan) << back.fault.reason;
  EXPECT_EQ(back.scan->stamp_ns, scan.stamp_ns);
  EXPECT_EQ(back.scan->points_lidar, scan.points_lidar);
  EXPECT_EQ(back.scan->intensity, scan.intensity);
  EXPECT_THAT(back.scan->time_offset_s, Pointwise(FloatNear(1e-6F), scan.time_offset_s));
  EXPECT_EQ(back.scan->ring, scan.ring);
  EXPECT_EQ(back.scan->labels, scan.labels);
}

TEST(CloudToScan, LeavesOutWhatTheScanDoesNotHave) {
  Scan scan = random_scan(10);
  scan.intensity.clear();
  scan.time_offset_s.clear();
  scan.ring.clear();
  scan.labels.clear();
  const ScanFromCloud back = to_scan(to_cloud(scan, {}, "lidar"), {});
  ASSERT_TRUE(back.scan);
  EXPECT_EQ(back.scan->size(), 10U);
  EXPECT_TRUE(back.scan->intensity.empty());
  EXPECT_TRUE(back.scan->time_offset_s.empty());
  EXPECT_TRUE(back.scan->ring.empty());
  EXPECT_TRUE(back.scan->labels.empty());
}

TEST(CloudToScan, ReducesRawLabelsSoThatMovingObjectsGiveNothingAway) {
  Scan scan = random_scan(3);
  // moving-car with instance 5, car, moving-person.
  const std::vector<std::uint32_t> raw = {(5U << 16U) | 252U, 10U, 254U};
  const ScanFromCloud back = to_scan(to_cloud(scan, raw, "lidar"), {});
  ASSERT_TRUE(back.scan);
  EXPECT_THAT(back.scan->labels,
              ElementsAre(SemanticClass::car, SemanticClass::car, SemanticClass::person));
}

TEST(CloudToScan, TakesClassNumbersWhenToldSo) {
  const auto cloud = three_points_with<std::uint8_t>("label", FieldType::uint8, {1, 19, 200});
  const ScanFromCloud back = to_scan(cloud, {.fields = {}, .labels_are_classes = true});
  ASSERT_TRUE(back.scan);
  EXPECT_THAT(back.scan->labels, ElementsAre(SemanticClass::car, SemanticClass::traffic_sign,
                                             SemanticClass::unlabeled));
}

TEST(CloudToScan, ReadsLabelsOf16Bits) {
  const auto cloud = three_points_with<std::uint16_t>("label", FieldType::uint16, {40, 50, 70});
  const ScanFromCloud back = to_scan(cloud, {});
  ASSERT_TRUE(back.scan);
  EXPECT_THAT(back.scan->labels,
              ElementsAre(SemanticClass::road, SemanticClass::building, SemanticClass::vegetation));
}

TEST(CloudToScan, TakesTheFirstCandidateNameThatIsThere) {
  const auto cloud =
      three_points_with<float>("reflectivity", FieldType::float32, {10.0F, 20.0F, 255.0F});
  const ScanFromCloud back = to_scan(
      cloud, {.fields = {.intensity = {"intensity", "reflectivity"}}, .intensity_scale = 0.1F});
  ASSERT_TRUE(back.scan);
  EXPECT_THAT(back.scan->intensity, Pointwise(FloatNear(1e-5F), {1.0F, 2.0F, 25.5F}));
}

template <typename T>
void expect_coordinates_of_type(FieldType type) {
  PointCloud2Builder columns(0, "lidar");
  const auto x = columns.add_field("x", type);
  const auto y = columns.add_field("y", type);
  const auto z = columns.add_field("z", type);
  columns.resize(1);
  columns.fill(x, [](std::size_t) { return static_cast<T>(1); });
  columns.fill(y, [](std::size_t) { return static_cast<T>(2); });
  columns.fill(z, [](std::size_t) { return static_cast<T>(100); });
  const CloudReadOptions as_it_is;
  const ScanFromCloud back = to_scan(columns.take(), as_it_is);
  ASSERT_TRUE(back.scan);
  EXPECT_EQ(back.scan->points_lidar.front(), Eigen::Vector3f(1.0F, 2.0F, 100.0F));
}

TEST(CloudToScan, ReadsCoordinatesByTheirNamesAndSigns) {
  CloudReadOptions options;
  options.fields.x = {"z"};
  options.fields.y = {"-left", "-x"};
  options.fields.z = {"y"};
  const ScanFromCloud read = to_scan(three_points(), options);
  ASSERT_TRUE(read.scan);
  EXPECT_THAT(
      read.scan->points_lidar,
      ElementsAre(Eigen::Vector3f(3, -1, 2), Eigen::Vector3f(6, -4, 5), Eigen::Vector3f(9, -7, 8)));
  EXPECT_THAT(read.format, HasSubstr("x from z, y from -left, z from y, "));
  options.fields.y = {"-left"};
  EXPECT_THAT(to_scan(three_points(), options).fault.reason, HasSubstr("no field left"));
  options.fields.y = {};
  EXPECT_EQ(to_scan(three_points(), options).fault.counter, "no_xyz");
}

TEST(CloudToScan, ReadsCoordinatesOfEveryType) {
  expect_coordinates_of_type<std::int8_t>(FieldType::int8);
  expect_coordinates_of_type<std::uint8_t>(FieldType::uint8);
  expect_coordinates_of_type<std::int16_t>(FieldType::int16);
  expect_coordinates_of_type<std::uint16_t>(FieldType::uint16);
  expect_coordinates_of_type<std::int32_t>(FieldType::int32);
  expect_coordinates_of_type<std::uint32_t>(FieldType::uint32);
  expect_coordinates_of_type<float>(FieldType::float32);
  expect_coordinates_of_type<double>(FieldType::float64);
}

TEST(CloudToScan, ReadsTimesInNanosecondsAndInAbsoluteSeconds) {
  const auto offsets_ns =
      three_points_with<std::uint32_t>("time", FieldType::uint32, {0, 50'000'000, 100'000'000});
  // The cloud's stamp is 1.5 s.
  const auto absolute_s = three_points_with<double>("time", FieldType::float64, {1.5, 1.55, 1.6});
  auto far_cloud =
      three_points_with<double>("time", FieldType::float64, {1.7e9, 1.7e9 + 0.05, 1.7e9 + 0.1});
  far_cloud.header(to_header(1'700'000'000'000'000'000, "lidar"));
  auto far_ns_cloud =
      three_points_with<double>("time", FieldType::float64, {1.7e18, 1.7e18 + 5e7, 1.7e18 + 1e8});
  far_ns_cloud.header(far_cloud.header());
  for (const auto& cloud : {offsets_ns, far_cloud, far_ns_cloud}) {
    const ScanFromCloud back = to_scan(cloud, {});
    ASSERT_TRUE(back.scan);
    EXPECT_THAT(back.scan->time_offset_s, Pointwise(FloatNear(1e-5F), {0.0F, 0.05F, 0.1F}));
  }
}

TEST(CloudToScan, ReadsBigEndianClouds) {
  auto cloud = three_points();
  auto& data = cloud.data();
  for (std::size_t i = 0; i < data.size(); i += 4) {
    std::reverse(data.begin() + static_cast<std::ptrdiff_t>(i),
                 data.begin() + static_cast<std::ptrdiff_t>(i + 4));
  }
  cloud.is_bigendian(true);
  const ScanFromCloud back = to_scan(cloud, {});
  ASSERT_TRUE(back.scan);
  EXPECT_EQ(back.scan->points_lidar[2], Eigen::Vector3f(7.0F, 8.0F, 9.0F));
}

TEST(CloudToScan, SkipsThePaddingOfRows) {
  auto cloud = three_points();
  // Three rows of one point, each with 5 bytes of padding.
  const std::vector<std::uint8_t> packed = cloud.data();
  std::vector<std::uint8_t> padded;
  for (std::size_t row = 0; row < 3; ++row) {
    const auto begin = packed.begin() + static_cast<std::ptrdiff_t>(row * 12);
    padded.insert(padded.end(), begin, begin + 12);
    padded.resize(padded.size() + 5, 0xFF);
  }
  cloud.width(1);
  cloud.height(3);
  cloud.row_step(17);
  cloud.data(padded);
  const ScanFromCloud back = to_scan(cloud, {});
  ASSERT_TRUE(back.scan);
  EXPECT_EQ(back.scan->points_lidar[1], Eigen::Vector3f(4.0F, 5.0F, 6.0F));
  EXPECT_EQ(back.scan->points_lidar[2], Eigen::Vector3f(7.0F, 8.0F, 9.0F));
}

TEST(CloudToScan, KeepsPointsThatAreNotFinite) {
  Scan scan = random_scan(3);
  scan.points_lidar[1].x() = std::numeric_limits<float>::quiet_NaN();
  scan.points_lidar[2].z() = std::numeric_limits<float>::infinity();
  const ScanFromCloud back = to_scan(to_cloud(scan, {}, "lidar"), {});
  ASSERT_TRUE(back.scan);
  EXPECT_EQ(back.scan->size(), 3U);
  EXPECT_TRUE(std::isnan(back.scan->points_lidar[1].x()));
  EXPECT_TRUE(std::isinf(back.scan->points_lidar[2].z()));
}

TEST(LabelledScanToCloud, CarriesClassConfidenceAndMotion) {
  LabelledScan labelled{
      .scan = random_scan(2),
      .labels = {.classes = {SemanticClass::car, SemanticClass::road}, .confidence = {0.5F, 1.0F}},
      .motion = {Motion::highly_dynamic, Motion::stationary}};
  const auto cloud = to_cloud(labelled, "lidar");
  const ScanFromCloud back = to_scan(
      cloud,
      {.fields = {.intensity = {"confidence"}, .ring = {"motion"}}, .labels_are_classes = true});
  ASSERT_TRUE(back.scan);
  EXPECT_EQ(back.scan->points_lidar, labelled.scan.points_lidar);
  EXPECT_EQ(back.scan->labels, labelled.labels.classes);
  EXPECT_EQ(back.scan->intensity, labelled.labels.confidence);
  EXPECT_THAT(back.scan->ring, ElementsAre(2, 0));
}

TEST(MapToCloud, ShowsTheVoxelsInTheWindow) {
  const VoxelGrid grid(0.2, 20.0);
  Voxel inside{
      .index = {5, 10, 15}, .point_count = 3, .mean_map = {1.1F, 2.1F, 3.1F}, .evidence = {}};
  inside.evidence.add(SemanticClass::building, 1.0F);
  Voxel outside{
      .index = {75, 10, 15}, .point_count = 3, .mean_map = {15.1F, 2.1F, 3.1F}, .evidence = {}};
  Tile tile;
  tile.voxels = PackedVoxels({}, grid, std::array{inside, outside});
  tile.info.bounds_map.extend(inside.mean_map);
  tile.info.bounds_map.extend(outside.mean_map);
  const MapSnapshot view{.version = 1, .tiles = {std::make_shared<const Tile>(tile)}};
  const auto cloud =
      to_cloud(view, {Eigen::Vector2f(-10.0F, -10.0F), Eigen::Vector2f(10.0F, 10.0F)}, 5, "map");
  const ScanFromCloud back = to_scan(cloud, {.fields = {}, .labels_are_classes = true});
  ASSERT_TRUE(back.scan);
  EXPECT_THAT(back.scan->points_lidar, ElementsAre(tile.voxels[0].mean_map));
  EXPECT_THAT(back.scan->labels, ElementsAre(SemanticClass::building));
}

TEST(CloudToScan, LabelsOf8BitsAreNoSemanticKittiIds) {
  const auto signed_bytes = three_points_with<std::int8_t>("label", FieldType::int8, {0, 10, 40});
  const auto bytes = three_points_with<std::uint8_t>("label", FieldType::uint8, {0, 10, 252});
  for (const auto& cloud : {signed_bytes, bytes}) {
    const ScanFromCloud back = to_scan(cloud, {});
    ASSERT_TRUE(back.scan) << back.fault.reason;
    EXPECT_TRUE(back.scan->labels.empty()) << "the network is to say what the points are";
  }
}

TEST(CloudToScan, TellsClassesThatAreReadAsIds) {
  const auto classes = three_points_with<std::uint32_t>("label", FieldType::uint32, {1, 9, 17});
  EXPECT_TRUE(to_scan(classes, {}).label_census.look_like_classes());
  const CloudReadOptions told{.fields = {}, .labels_are_classes = true};
  EXPECT_FALSE(to_scan(classes, told).label_census.look_like_classes());
  const auto ids = three_points_with<std::uint32_t>("label", FieldType::uint32, {10, 33, 50});
  EXPECT_FALSE(to_scan(ids, {}).label_census.look_like_classes());
  EXPECT_EQ(to_scan(ids, {}).label_census.unknown(), 1U);
}

TEST(CloudToScan, KeepsRawLabelsWhereAskedTo) {
  const auto ids = three_points_with<std::uint32_t>("label", FieldType::uint32, {252, 33, 65586});
  EXPECT_THAT(to_scan(ids, {}).raw_labels, testing::IsEmpty());
  const CloudReadOptions keeping{.fields = {}, .keeps_raw_labels = true};
  EXPECT_THAT(to_scan(ids, keeping).raw_labels, ElementsAre(252U, 33U, 65586U));
}

TEST(CloudToScan, TakesLabelsInFloatsWhereTheyAreWholeNumbers) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  const auto whole = three_points_with<float>("label", FieldType::float32, {40.0F, nan, 252.0F});
  const ScanFromCloud back = to_scan(whole, {});
  ASSERT_TRUE(back.scan) << back.fault.reason;
  EXPECT_THAT(back.scan->labels,
              ElementsAre(SemanticClass::road, SemanticClass::unlabeled, SemanticClass::car));
  EXPECT_THAT(back.format, HasSubstr("label from label (float32: SemanticKITTI ids)"));
}

TEST(CloudToScan, LeavesLabelsInFloatsOutThatAreNoWholeNumbers) {
  for (const double odd : {0.5, -1.0, 1e300}) {
    const auto cloud = three_points_with<double>("label", FieldType::float64, {40.0, odd, 50.0});
    const ScanFromCloud back = to_scan(cloud, {});
    ASSERT_TRUE(back.scan) << "the points are to be mapped all the same: " << back.fault.reason;
    EXPECT_TRUE(back.scan->labels.empty()) << odd;
    EXPECT_THAT(back.format, HasSubstr("label from label (float64: ignored: not whole numbers)"));
  }
}

TEST(CloudToScan, LeavesLabelsOutThatFloatsHaveRounded) {
  // Ids with instances: 2 << 16 | 50 stays whole, 256 << 16 | 50 becomes the next multiple of 2.
  const auto exact =
      three_points_with<float>("label", FieldType::float32, {40.0F, 131122.0F, 0.0F});
  EXPECT_THAT(to_scan(exact, {}).scan->labels,
              ElementsAre(SemanticClass::road, SemanticClass::building, SemanticClass::unlabeled));
  for (const float rounded : {16777216.0F, 1000.0F * 65536.0F}) {
    const auto cloud =
        three_points_with<float>("label", FieldType::float32, {40.0F, rounded, 0.0F});
    const ScanFromCloud back = to_scan(cloud, {});
    EXPECT_TRUE(back.scan->labels.empty()) << rounded;
    EXPECT_EQ(back.label_census.labels(), 0U);
    EXPECT_THAT(back.format, HasSubstr("float32: ignored: not whole numbers below 2^24"));
  }
  const auto doubles =
      three_points_with<double>("label", FieldType::float64, {40.0, 1000.0 * 65536.0 + 50.0, 0.0});
  EXPECT_EQ(to_scan(doubles, {}).scan->labels[1], SemanticClass::building);
}

TEST(CloudToScan, SaysWhatTheLabelFieldIsTakenFor) {
  const auto bytes = three_points_with<std::uint8_t>("label", FieldType::uint8, {1, 2, 3});
  const auto ids = three_points_with<std::uint32_t>("label", FieldType::uint32, {10, 40, 50});
  const CloudReadOptions classes{.fields = {}, .labels_are_classes = true};
  EXPECT_THAT(to_scan(bytes, {}).format, HasSubstr("label from label (uint8: ignored)"));
  EXPECT_THAT(to_scan(bytes, classes).format, HasSubstr("label from label (uint8: classes)"));
  EXPECT_THAT(to_scan(ids, {}).format, HasSubstr("label from label (uint32: SemanticKITTI ids)"));
  EXPECT_THAT(to_scan(three_points(), {}).format, Not(HasSubstr("label")));
}

}  // namespace
}  // namespace stillmap::wire
