#include "core/dataset/merged_cloud.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <vector>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "tests/dataset/edited_ply.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::AllOf;
using testing::HasSubstr;

MergedPoint point(std::uint32_t scan, std::uint32_t index, std::uint32_t raw_label) {
  return {.position = {1.5F, -2.0F, 0.25F},
          .intensity = 0.5F,
          .raw_label = raw_label,
          .scan = scan,
          .point = index};
}

void write(const std::filesystem::path& file, const std::vector<MergedPoint>& points) {
  MergedCloudWriter writer(file, Eigen::Vector3d(100, -20, 0), false);
  for (const MergedPoint& one : points) writer.add(one);
  writer.finish();
}

std::vector<EditedPoint> read(const std::filesystem::path& file) {
  MergedCloudReader reader(file);
  std::vector<EditedPoint> points;
  for (std::uint64_t i = 0; i < reader.size(); ++i) points.push_back(reader.next());
  return points;
}

constexpr std::uint32_t car_of_instance_300 = (300U << 16U) | 10U;

TEST(MergedCloud, WhatIsWrittenComesBack) {
  const ScratchFolder folder;
  std::vector<MergedPoint> points;
  std::mt19937 random(1);
  // More than a write's worth.
  for (std::uint32_t i = 0; i < 30'000; ++i) {
    points.push_back(point(i / 100, i % 100, static_cast<std::uint32_t>(random())));
  }
  write(folder / "a.ply", points);
  const std::vector<EditedPoint> back = read(folder / "a.ply");
  ASSERT_EQ(back.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_EQ(back[i].scan, points[i].scan);
    ASSERT_EQ(back[i].point, points[i].point);
    ASSERT_EQ(back[i].label | (back[i].instance.value() << 16U), points[i].raw_label);
  }
}

TEST(MergedCloud, OtherProgramsReadItsPointsAndItSaysWhereTheOriginIs) {
  const ScratchFolder folder;
  write(folder / "a.ply", {point(3, 7, car_of_instance_300)});
  const CloudFile cloud = read_point_cloud(folder / "a.ply", 0);
  ASSERT_EQ(cloud.scan.size(), 1U);
  EXPECT_EQ(cloud.scan.points_lidar[0], Eigen::Vector3f(1.5F, -2.0F, 0.25F));
  EXPECT_EQ(cloud.scan.intensity[0], 0.5F);
  EXPECT_EQ(cloud.raw_labels[0], 10U);
  EXPECT_THAT(content_of(folder / "a.ply"), HasSubstr("\ncomment origin_map_m 100 -20 0\n"));
}

TEST(MergedCloud, AnUnfinishedCloudLeavesNothingBehind) {
  const ScratchFolder folder;
  { MergedCloudWriter(folder / "a.ply", Eigen::Vector3d::Zero(), false).add(point(0, 0, 1)); }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(MergedCloud, IsReplacedOnlyWhenAsked) {
  const ScratchFolder folder;
  const auto file = folder.file("a.ply", "precious");
  EXPECT_THAT(message_of<DatasetError>([&] { write(file, {}); }),
              AllOf(HasSubstr("a.ply"), HasSubstr("--force")));
  EXPECT_EQ(content_of(file), "precious");
  MergedCloudWriter(file, Eigen::Vector3d::Zero(), true).finish();
  EXPECT_TRUE(read(file).empty());
}

class EveryEncoding : public testing::TestWithParam<std::string> {};

TEST_P(EveryEncoding, FieldsOfAnyOrderAndTypeAreFoundByName) {
  const ScratchFolder folder;
  const std::vector<PlyField> fields{{"uchar", "red"},          {"double", "scalar_Point_Index"},
                                     {"float", "scalar_label"}, {"short", "quality"},
                                     {"float", "instance"},     {"int", "Scan_Index"}};
  const auto file = folder.file(
      "edited.ply",
      ply_text(GetParam(), fields, {{255, 131'071, 252, -3, 300, 4540}, {0, 0, 0, 7, 0, 0}}));
  const std::vector<EditedPoint> points = read(file);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[0].scan, 4540U);
  EXPECT_EQ(points[0].point, 131'071U);
  EXPECT_EQ(points[0].label, 252U);
  EXPECT_EQ(points[0].instance, 300U);
  EXPECT_EQ(points[1].label, 0U);
}

INSTANTIATE_TEST_SUITE_P(MergedCloud, EveryEncoding,
                         testing::Values("ascii", "binary_little_endian", "binary_big_endian"));

std::string fault_of(const std::vector<PlyField>& fields, const std::vector<double>& values,
                     const std::string& encoding = "ascii") {
  const ScratchFolder folder;
  const auto file = folder.file("edited.ply", ply_text(encoding, fields, {values}));
  return message_of<DatasetError>([&] { (void)read(file); });
}

TEST(MergedCloudReader, NamesTheFieldThatIsMissingAndThoseThatAreThere) {
  EXPECT_THAT(fault_of({{"float", "x"}, {"int", "label"}, {"int", "scan_index"}}, {0, 0, 0}),
              AllOf(HasSubstr("point_index"), HasSubstr("x label scan_index")));
}

TEST(MergedCloudReader, RefusesLabelsThatAreNoLabels) {
  const std::vector<PlyField> fields{
      {"double", "label"}, {"double", "scan_index"}, {"float", "point_index"}};
  for (const double label : {-1.0, 10.5, 5e9, std::numeric_limits<double>::quiet_NaN()}) {
    for (const char* encoding : {"ascii", "binary_big_endian"}) {
      EXPECT_THAT(fault_of(fields, {label, 0, 0}, encoding),
                  AllOf(HasSubstr("point 0"), HasSubstr("label")))
          << label;
    }
  }
  EXPECT_THAT(fault_of(fields, {10, 0, 33'554'432.0}), HasSubstr("point_index"));
}

TEST(MergedCloudReader, RefusesARoundedLabel) {
  // Class and instance in one float: 24 bits are not enough.
  EXPECT_THAT(fault_of({{"float", "label"}, {"int", "scan_index"}, {"int", "point_index"}},
                       {static_cast<double>(car_of_instance_300), 0, 0}, "binary_little_endian"),
              HasSubstr("16777216"));
}

TEST(MergedCloudReader, SurvivesDamagedFiles) {
  const ScratchFolder folder;
  write(folder / "whole.ply", {point(0, 0, 10), point(0, 1, 40), point(1, 0, 50)});
  const std::string whole = content_of(folder / "whole.ply");
  std::mt19937 random(7);
  for (int i = 0; i < 300; ++i) {
    std::string damaged = whole.substr(0, random() % whole.size());
    if (i % 2 == 0) {
      damaged = whole;
      for (int k = 0; k < 5; ++k) damaged[random() % damaged.size()] = static_cast<char>(random());
    }
    const auto file = folder.file("damaged.ply", damaged);
    try {
      EXPECT_LE(read(file).size(), 3U);
    } catch (const DatasetError& error) {
      EXPECT_THAT(error.what(), HasSubstr("damaged.ply"));
    }
  }
}

TEST(MergedCloudReader, RefusesOtherFiles) {
  const ScratchFolder folder;
  EXPECT_THROW(MergedCloudReader(folder / "nothing.ply"), DatasetError);
  EXPECT_THROW(MergedCloudReader(folder.path()), DatasetError);
  EXPECT_THROW(MergedCloudReader(folder.file("a.txt", "hello")), DatasetError);
  EXPECT_THROW(MergedCloudReader(folder.file("b.ply", "")), DatasetError);
  EXPECT_THAT(message_of<DatasetError>([&] {
                MergedCloudReader(
                    folder.file("c.ply",
                                "ply\nformat binary_little_endian 1.0\nelement vertex 900000000\n"
                                "property uint label\nend_header\n"));
              }),
              HasSubstr("truncated"));
}

}  // namespace
}  // namespace stillmap
