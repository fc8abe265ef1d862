// Scans to one cloud and labels back to the scans.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <map>
#include <random>
#include <stdexcept>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/dataset/kitti_sequence_writer.hpp"
#include "core/dataset/label_scatter.hpp"
#include "core/dataset/merged_cloud.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "core/dataset/scan_merge.hpp"
#include "tests/dataset/edited_ply.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::AllOf;
using testing::HasSubstr;

namespace fs = std::filesystem;

/// Pose of the lidar in the synthetic sequence at scan k.
Eigen::Isometry3d pose_at(std::size_t k) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.rotate(Eigen::AngleAxisd(0.3 * static_cast<double>(k), Eigen::Vector3d::UnitZ()));
  T.pretranslate(Eigen::Vector3d(2.5 * static_cast<double>(k), static_cast<double>(k), 0.0));
  return T;
}

class LabelRoundTrip : public testing::Test {
 protected:
  static constexpr std::size_t scans = 4;

  void SetUp() override {
    std::mt19937 random(3);
    std::uniform_real_distribution<float> coordinate(-40.0F, 40.0F);
    KittiSequenceWriter writer(sequence_);
    for (std::size_t k = 0; k < scans; ++k) {
      Scan scan;
      scan.stamp_ns = static_cast<std::int64_t>(k) * 100'000'000;
      std::vector<std::uint32_t> raw_labels;
      for (std::size_t i = 0; i < 200 + k; ++i) {
        scan.points_lidar.emplace_back(coordinate(random), coordinate(random), 0.1F);
        scan.intensity.push_back(0.25F);
        raw_labels.push_back(static_cast<std::uint32_t>(random()));
      }
      writer.add(scan, raw_labels, pose_at(k));
    }
    writer.finish();
  }

  [[nodiscard]] MergedClouds merge(const MergeOptions& options = {}) const {
    return merge_scans(ScanDataset(sequence_), cloud_, options);
  }
  [[nodiscard]] std::vector<std::uint32_t> labels(const std::string& number) const {
    const auto bytes = fs::file_size(sequence_ / "labels" / (number + ".label"));
    return read_kitti_labels(sequence_ / "labels" / (number + ".label"), bytes / 4);
  }
  [[nodiscard]] std::map<std::string, std::string> all_label_files() const {
    std::map<std::string, std::string> content;
    for (const auto& entry : fs::directory_iterator(sequence_ / "labels")) {
      content[entry.path().filename().string()] = content_of(entry.path());
    }
    return content;
  }
  /// A cloud of these fields with one point of scan 1.
  [[nodiscard]] std::string scatter_fault(const std::vector<double>& scan_point_label) const {
    const std::vector<PlyField> fields{
        {"int", "scan_index"}, {"int", "point_index"}, {"int", "label"}};
    const auto edited = folder_.file("edited.ply", ply_text("ascii", fields, {scan_point_label}));
    return message_of<DatasetError>([&] { (void)scatter_labels(edited, sequence_); });
  }

  ScratchFolder folder_;
  fs::path sequence_ = folder_ / "sequence";
  fs::path cloud_ = folder_ / "cloud.ply";
};

TEST_F(LabelRoundTrip, AnUntouchedCloudChangesNoByte) {
  const auto before = all_label_files();
  const MergedClouds merged = merge();
  EXPECT_EQ(merged.scans, scans);
  EXPECT_EQ(merged.points, 200U + 201U + 202U + 203U);
  const ScatterResult result = scatter_labels(cloud_, sequence_);
  EXPECT_EQ(result.points_in_cloud, merged.points);
  EXPECT_EQ(result.points_missing, 0U);
  EXPECT_EQ(result.labels_changed, 0U);
  EXPECT_EQ(all_label_files(), before);
  EXPECT_FALSE(fs::exists(sequence_ / "labels.bak"));
}

TEST_F(LabelRoundTrip, PointsStandInTheMapFrameRelativeToTheStatedOrigin) {
  const MergedClouds merged = merge({.first = 2, .last = 2});
  EXPECT_EQ(merged.origin_map, Eigen::Vector3d(5, 2, 0));
  const ScanDataset sequence(sequence_);
  const Scan scan = sequence.read(2).scan;
  const CloudFile cloud = read_point_cloud(cloud_, 0);
  ASSERT_EQ(cloud.scan.size(), scan.size());
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const Eigen::Vector3d expected = pose_at(2) * scan.points_lidar[i].cast<double>();
    const Eigen::Vector3d stored = cloud.scan.points_lidar[i].cast<double>() + merged.origin_map;
    ASSERT_LT((stored - expected).norm(), 1e-5);
  }
}

TEST_F(LabelRoundTrip, EditsArriveAtExactlyTheirPoints) {
  (void)merge();
  MergedCloudReader reader(cloud_);
  std::vector<std::vector<double>> rows;
  for (std::uint64_t i = 0; i < reader.size(); ++i) {
    const EditedPoint p = reader.next();
    // Every seventh point becomes road; scan 2's first hundred points are deleted.
    if (p.scan == 2 && p.point < 100) continue;
    const bool edited = p.point % 7 == 0;
    rows.push_back({static_cast<double>(p.point), edited ? 40.0 : p.label,
                    edited ? 0.0 : p.instance.value(), static_cast<double>(p.scan)});
  }
  std::ranges::shuffle(rows, std::mt19937(5));
  const std::vector<PlyField> fields{{"float", "scalar_point_index"},
                                     {"float", "scalar_label"},
                                     {"float", "scalar_instance"},
                                     {"float", "scalar_scan_index"}};
  const auto edited = folder_.file("edited.ply", ply_text("binary_little_endian", fields, rows));
  std::vector<std::vector<std::uint32_t>> expected;
  for (std::size_t k = 0; k < scans; ++k) {
    expected.push_back(labels("00000" + std::to_string(k)));
    for (std::size_t i = k == 2 ? 105 : 0; i < expected[k].size(); i += 7) expected[k][i] = 40;
  }
  const auto before = all_label_files();
  const ScatterResult result = scatter_labels(edited, sequence_);
  EXPECT_EQ(result.points_missing, 100U);
  EXPECT_EQ(result.scans_changed, scans);
  for (std::size_t k = 0; k < scans; ++k) {
    EXPECT_EQ(labels("00000" + std::to_string(k)), expected[k]) << k;
    const std::string name = "00000" + std::to_string(k) + ".label";
    EXPECT_EQ(content_of(sequence_ / "labels.bak" / name), before.at(name));
  }
}

TEST_F(LabelRoundTrip, TheBackupIsThatBeforeTheFirstChange) {
  const std::string before = content_of(sequence_ / "labels/000001.label");
  const std::vector<PlyField> fields{
      {"int", "scan_index"}, {"int", "point_index"}, {"int", "label"}};
  for (const double label : {40.0, 48.0}) {
    const auto edited = folder_.file("edited.ply", ply_text("ascii", fields, {{1, 5, label}}));
    const ScatterResult result = scatter_labels(edited, sequence_);
    EXPECT_EQ(result.scans_changed, 1U);
    EXPECT_EQ(labels("000001")[5], static_cast<std::uint32_t>(label));
  }
  EXPECT_EQ(content_of(sequence_ / "labels.bak/000001.label"), before);
  EXPECT_FALSE(fs::exists(sequence_ / "labels.bak/000000.label"));
}

TEST_F(LabelRoundTrip, WithoutInstanceFieldOnlyChangedClassesLoseTheirInstance) {
  const std::uint32_t first = (9U << 16U) | 10U, second = (8U << 16U) | 30U;
  const fs::path file = sequence_ / "labels/000000.label";
  std::vector<std::uint32_t> raw = labels("000000");
  raw[0] = first;
  raw[1] = second;
  write_kitti_labels(file, raw);
  const std::vector<PlyField> fields{
      {"int", "scan_index"}, {"int", "point_index"}, {"double", "label"}};
  const auto edited = folder_.file(
      "edited.ply", ply_text("ascii", fields, {{0, 0, 10}, {0, 1, 31}, {0, 2, (77 << 16) + 252}}));
  const ScatterResult result = scatter_labels(edited, sequence_);
  EXPECT_EQ(labels("000000")[0], first);
  EXPECT_EQ(labels("000000")[1], 31U);
  EXPECT_EQ(labels("000000")[2], (77U << 16U) | 252U);
  EXPECT_EQ(result.instances_dropped, 1U);
}

TEST_F(LabelRoundTrip, ForeignAndContradictingCloudsChangeNothing) {
  const auto before = all_label_files();
  EXPECT_THAT(scatter_fault({17, 0, 40}), AllOf(HasSubstr("edited.ply"), HasSubstr("scan 17")));
  EXPECT_THAT(scatter_fault({1, 5000, 40}), AllOf(HasSubstr("point 5000"), HasSubstr("201")));
  const std::vector<PlyField> fields{
      {"int", "scan_index"}, {"int", "point_index"}, {"int", "label"}};
  const auto edited =
      folder_.file("twice.ply", ply_text("ascii", fields, {{0, 3, 40}, {1, 5, 40}, {1, 5, 48}}));
  EXPECT_THAT(message_of<DatasetError>([&] { (void)scatter_labels(edited, sequence_); }),
              AllOf(HasSubstr("twice"), HasSubstr("point 5 of scan 1")));
  EXPECT_EQ(all_label_files(), before);
}

TEST_F(LabelRoundTrip, TilesTogetherHoldEveryPointOnce) {
  const auto before = all_label_files();
  const MergedClouds merged = merge({.tile_m = 20.0});
  EXPECT_GT(merged.files.size(), 8U);
  std::uint64_t points = 0, missing = 0;
  for (const fs::path& tile : merged.files) {
    EXPECT_THAT(tile.filename().string(), testing::StartsWith("cloud_x"));
    const ScatterResult result = scatter_labels(tile, sequence_);
    points += result.points_in_cloud;
    missing += result.points_missing;
    EXPECT_EQ(result.labels_changed, 0U);
  }
  EXPECT_EQ(points, merged.points);
  EXPECT_GT(missing, 0U);
  EXPECT_EQ(all_label_files(), before);
}

TEST_F(LabelRoundTrip, ScansAreChosenByNumberAndKeepItWhenOthersGo) {
  fs::remove(sequence_ / "velodyne/000000.bin");
  fs::remove(sequence_ / "labels/000000.label");
  const MergedClouds merged = merge({.first = 1, .last = 3, .every = 2});
  EXPECT_EQ(merged.scans, 2U);
  const std::vector<EditedPoint> ends = [&] {
    MergedCloudReader reader(cloud_);
    std::vector<EditedPoint> points;
    for (std::uint64_t i = 0; i < reader.size(); ++i) points.push_back(reader.next());
    return std::vector<EditedPoint>{points.front(), points.back()};
  }();
  EXPECT_EQ(ends[0].scan, 1U);
  EXPECT_EQ(ends[1].scan, 3U);
  EXPECT_EQ(ends[1].point, 202U);
}

TEST_F(LabelRoundTrip, PointsWithoutCoordinatesAreLeftOutAndKeepTheirLabels) {
  Scan scan = read_kitti_bin(sequence_ / "velodyne/000003.bin");
  scan.points_lidar[10].x() = std::numeric_limits<float>::quiet_NaN();
  write_kitti_bin(sequence_ / "velodyne/000003.bin", scan);
  const auto before = all_label_files();
  EXPECT_EQ(merge().left_out, 1U);
  EXPECT_EQ(scatter_labels(cloud_, sequence_).points_missing, 1U);
  EXPECT_EQ(all_label_files(), before);
}

TEST_F(LabelRoundTrip, SequencesThatCannotBeMergedAreNamed) {
  EXPECT_THROW((void)merge({.first = 3, .last = 2}), std::invalid_argument);
  EXPECT_THROW((void)merge({.every = 0}), std::invalid_argument);
  EXPECT_THAT(message_of<DatasetError>([&] { (void)merge({.first = 9}); }), HasSubstr("from 9"));
  fs::remove(sequence_ / "poses.txt");
  EXPECT_THAT(message_of<DatasetError>([&] { (void)merge(); }), HasSubstr("poses.txt"));
  fs::rename(sequence_ / "velodyne/000000.bin", sequence_ / "velodyne/first.bin");
  EXPECT_THAT(message_of<DatasetError>([&] { (void)merge(); }), HasSubstr("first.bin"));
  EXPECT_FALSE(fs::exists(cloud_));
}

TEST_F(LabelRoundTrip, ARollingScanIsMergedAsIfTakenInOneInstant) {
  const fs::path rolling = folder_ / "rolling";
  KittiSequenceWriter writer(rolling);
  // One thing at x = 20 m, seen by a lidar that drives towards it at 10 m/s.
  for (int k = 0; k < 3; ++k) {
    Scan scan;
    scan.stamp_ns = k * 100'000'000;
    for (const float offset_s : {0.0F, 0.05F, 0.1F}) {
      scan.points_lidar.emplace_back(20.0F - static_cast<float>(k) - 10.0F * offset_s, 0.0F, 0.0F);
      scan.intensity.push_back(0.0F);
      scan.time_offset_s.push_back(offset_s);
    }
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().x() = k;
    writer.add(scan, {}, T);
  }
  writer.finish();
  (void)merge_scans(ScanDataset(rolling), cloud_, {});
  for (const auto& position : read_point_cloud(cloud_, 0).scan.points_lidar) {
    EXPECT_NEAR(position.x(), 20.0F, 1e-4F);
  }
}

TEST(RealLabelRoundTrip, LeavesSemanticKittiLabelsAsTheyAre) {
  const char* data = std::getenv("STILLMAP_TEST_DATA");
  if (data == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA names no folder of recordings";
  const fs::path source = fs::path(data) / "kitti_odom_00";
  if (!fs::exists(source)) GTEST_SKIP() << source << " is absent";
  const ScratchFolder folder;
  const fs::path sequence = folder / "sequence", cloud = folder / "cloud.ply";
  fs::copy(source, sequence, fs::copy_options::recursive);
  fs::permissions(sequence / "labels", fs::perms::owner_all);
  const std::string before = content_of(source / "labels/000000.label");
  const MergedClouds merged = merge_scans(ScanDataset(sequence), cloud, {});
  const ScatterResult result = scatter_labels(cloud, sequence);
  EXPECT_EQ(result.points_in_cloud, merged.points);
  EXPECT_EQ(result.points_missing, merged.left_out);
  EXPECT_EQ(result.labels_changed, 0U);
  EXPECT_EQ(content_of(sequence / "labels/000000.label"), before);
}

}  // namespace
}  // namespace stillmap
