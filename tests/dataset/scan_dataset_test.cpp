#include "core/dataset/scan_dataset.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/dataset/kitti_sequence_writer.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "tests/dataset/kitti_lidar_scan.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

Scan small_scan(std::size_t points, std::int64_t stamp_ns) {
  Scan scan;
  scan.stamp_ns = stamp_ns;
  for (std::size_t i = 0; i < points; ++i) {
    scan.points_lidar.emplace_back(static_cast<float>(i + 1), 2.0F, -1.0F);
    scan.intensity.push_back(0.25F);
  }
  return scan;
}

Eigen::Isometry3d pose_at(double x, double yaw) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.rotate(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
  T.pretranslate(Eigen::Vector3d(x, 0.5 * x, 0.1));
  return T;
}

std::vector<std::string> names_of(const ScanDataset& dataset) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < dataset.size(); ++i) {
    names.push_back(dataset.file(i).filename().string());
  }
  return names;
}

/// A PCD of one point.
std::string pcd(const std::string& intensity = "0.5") {
  return "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
         "WIDTH 1\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA ascii\n1 2 0 " +
         intensity + "\n";
}

TEST(KittiSequenceWriter, WhatIsWrittenComesBack) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path() / "sequence");
  std::vector<std::vector<std::uint32_t>> raw_labels;
  for (std::size_t k = 0; k < 3; ++k) {
    Scan scan = small_scan(4 + k, 1'600'000'000'000'000'123 + static_cast<std::int64_t>(k) * 99);
    for (std::size_t i = 0; i < scan.size(); ++i) {
      scan.time_offset_s.push_back(0.01F * static_cast<float>(i));
      scan.ring.push_back(static_cast<std::uint16_t>(15 - i));
    }
    raw_labels.emplace_back(scan.size(), (5U << 16U) | 252U);
    writer.add(scan, raw_labels.back(), pose_at(10.0 + static_cast<double>(k), 0.1));
  }
  writer.finish();

  const ScanDataset dataset(folder.path() / "sequence");
  ASSERT_EQ(dataset.size(), 3U);
  EXPECT_EQ(dataset.suggested_sensor().name, "VLP-16");
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_TRUE(dataset.has_labels(k));
    const DatasetFrame frame = dataset.read(k);
    const Scan expected = small_scan(4 + k, 0);
    EXPECT_EQ(frame.scan.stamp_ns, 1'600'000'000'000'000'123 + static_cast<std::int64_t>(k) * 99);
    EXPECT_EQ(frame.scan.points_lidar, expected.points_lidar);
    EXPECT_EQ(frame.scan.intensity, expected.intensity);
    EXPECT_FLOAT_EQ(frame.scan.time_offset_s.at(3), 0.03F);
    EXPECT_EQ(frame.scan.ring.at(3), 12);
    EXPECT_EQ(frame.raw_labels, raw_labels[k]);
    // The moving id is truth; what odometry and map may see is a car.
    EXPECT_THAT(frame.scan.labels, testing::Each(SemanticClass::car));
  }
}

TEST(ScanDataset, TakesAFieldThatNobodyFilledForNoLabels) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path());
  const std::vector<std::uint32_t> unfilled(3, 0);
  for (int k = 0; k < 3; ++k) writer.add(small_scan(3, 100 * k), unfilled, pose_at(k, 0.0));
  writer.finish();
  EXPECT_FALSE(ScanDataset(folder.path()).has_labels());
}

TEST(ScanDataset, TellsWhetherSomeScansLackLabels) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path());
  // More than are looked at when it is opened.
  constexpr int scans = 12;
  const std::vector<std::uint32_t> cars(3, 10);
  for (int k = 0; k < scans; ++k) writer.add(small_scan(3, 100 * k), cars, pose_at(k, 0.0));
  writer.finish();
  const auto remove_labels = [&](int scan) {
    const std::string name = (scan < 10 ? "00000" : "0000") + std::to_string(scan);
    std::filesystem::remove(folder.path() / "labels" / (name + ".label"));
  };
  const auto labels = [&] {
    const ScanDataset dataset(folder.path());
    return std::pair(dataset.has_labels(), dataset.lacks_labels());
  };
  EXPECT_EQ(labels(), std::pair(true, false));
  remove_labels(3);
  EXPECT_EQ(labels(), std::pair(true, true)) << "one in the midst, which is not looked at";
  remove_labels(0);
  EXPECT_EQ(labels(), std::pair(true, true)) << "the first one";
  for (int k = 1; k < scans; ++k) remove_labels(k);
  EXPECT_EQ(labels(), std::pair(false, true));
}

TEST(ScanDataset, ReadsLabelsOfTheKindThatItIsTold) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path());
  // Vegetation and terrain as classes; 15 is a motorcycle as an id, and 17 is none.
  writer.add(small_scan(3, 0), std::vector<std::uint32_t>{15, 17, 0}, pose_at(0, 0.0));
  writer.finish();
  const ScanDataset untold(folder.path());
  EXPECT_TRUE(untold.label_census().look_like_classes());
  EXPECT_EQ(untold.label_census().unknown(), 1U);
  EXPECT_EQ(untold.read(0).scan.labels[0], SemanticClass::motorcycle);
  EXPECT_FALSE(
      ScanDataset(folder.path(), LabelKind::semantic_kitti).label_census().look_like_classes())
      << "who says so is believed";
  const ScanDataset classes(folder.path(), LabelKind::classes);
  EXPECT_FALSE(classes.label_census().look_like_classes());
  EXPECT_THAT(classes.read(0).raw_labels, ElementsAre(70U, 72U, 0U));
  EXPECT_THAT(
      classes.read(0).scan.labels,
      ElementsAre(SemanticClass::vegetation, SemanticClass::terrain, SemanticClass::unlabeled));
}

TEST(KittiSequenceWriter, TruthIsInTheFirstLidarFrame) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path());
  for (int k = 0; k < 4; ++k) writer.add(small_scan(2, 100 * k), {}, pose_at(3.0 * k, 0.2 * k + 1));
  writer.finish();
  const auto truth = ScanDataset(folder.path()).truth();
  ASSERT_TRUE(truth.has_value());
  ASSERT_EQ(truth->size(), 4U);
  for (int k = 0; k < 4; ++k) {
    const Eigen::Isometry3d expected = pose_at(0.0, 1).inverse() * pose_at(3.0 * k, 0.2 * k + 1);
    const StampedPose& pose = truth->at(static_cast<std::size_t>(k));
    EXPECT_LT((pose.T_map_lidar.matrix() - expected.matrix()).norm(), 1e-9);
    EXPECT_EQ(pose.stamp_ns, 100 * k);
  }
}

TEST(KittiSequenceWriter, RefusesAnExistingSequenceAndUnevenScans) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path());
  EXPECT_THAT(message_of<DatasetError>([&] { KittiSequenceWriter again(folder.path()); }),
              HasSubstr("already"));
  EXPECT_THROW(writer.add(small_scan(3, 0), std::vector<std::uint32_t>(2), pose_at(0, 0)),
               DatasetError);
}

TEST(ScanDataset, ReadsAFolderInNaturalOrder) {
  const ScratchFolder folder;
  for (const char* name : {"10.pcd", "9.pcd", "100.pcd", "2.pcd"}) (void)folder.file(name, pcd());
  (void)folder.file("readme.txt", "not a scan");
  const ScanDataset dataset(folder.path());
  EXPECT_THAT(names_of(dataset), ElementsAre("2.pcd", "9.pcd", "10.pcd", "100.pcd"));
  EXPECT_EQ(dataset.stamp_ns(0), 0);
  EXPECT_EQ(dataset.stamp_ns(3), 300'000'000);
  EXPECT_FALSE(dataset.truth().has_value());
  EXPECT_FALSE(dataset.has_labels(0));
}

TEST(ScanDataset, TakesStampsFromFileNames) {
  const ScratchFolder folder;
  (void)folder.file("1539765928.346003000.pcd", pcd());
  (void)folder.file("1539765928.446003001.pcd", pcd());
  const ScanDataset dataset(folder.path());
  EXPECT_EQ(dataset.stamp_ns(0), 1'539'765'928'346'003'000);
  EXPECT_EQ(dataset.read(1).scan.stamp_ns, 1'539'765'928'446'003'001);
}

TEST(ScanDataset, OrdersStampsByTheirTime) {
  const ScratchFolder folder;
  // As Python writes a float.
  for (const char* name : {"12.5.pcd", "12.25.pcd", "12.05.pcd", "12.1.pcd", "9.75.pcd"})
    (void)folder.file(name, pcd());
  const ScanDataset dataset(folder.path());
  EXPECT_THAT(names_of(dataset),
              ElementsAre("9.75.pcd", "12.05.pcd", "12.1.pcd", "12.25.pcd", "12.5.pcd"));
  for (std::size_t i = 1; i < dataset.size(); ++i)
    EXPECT_GT(dataset.stamp_ns(i), dataset.stamp_ns(i - 1));
}

TEST(ScanDataset, ADamagedFirstScanSaysNothingOfTheOthersLabels) {
  const ScratchFolder folder;
  (void)folder.file("0.pcd", pcd().substr(0, 40));
  for (const char* name : {"1.pcd", "2.pcd"}) (void)folder.file(name, pcd());
  const ScanDataset dataset(folder.path());
  EXPECT_FALSE(dataset.has_labels());
  EXPECT_THROW(static_cast<void>(dataset.has_labels(0)), DatasetError);
}

TEST(ScanDataset, TellsWhatTheFilesOfKittisLidarHold) {
  const ScratchFolder folder;
  const Scan drawn = test::draw({.way_m = 0.5});
  for (const char* name : {"0.bin", "1.bin", "2.bin"}) write_kitti_bin(folder.path() / name, drawn);
  const ScanDataset dataset(folder.path());
  ASSERT_TRUE(dataset.kitti_lidar());
  EXPECT_EQ(dataset.read_uncorrected(1).scan.points_lidar, drawn.points_lidar);
  EXPECT_NE(dataset.read(1).scan.points_lidar, drawn.points_lidar);
}

TEST(ScanDataset, ReadsASingleFile) {
  const ScratchFolder folder;
  const auto file = folder.file("scan.pcd", pcd());
  const ScanDataset dataset(file);
  ASSERT_EQ(dataset.size(), 1U);
  EXPECT_EQ(dataset.read(0).scan.size(), 1U);
}

TEST(ScanDataset, ReadsTheVelodyneFolderOfASequenceLikeTheSequence) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path());
  writer.add(small_scan(2, 5), std::vector<std::uint32_t>{40, 40}, pose_at(0, 0));
  writer.finish();
  const ScanDataset dataset(folder.path() / "velodyne");
  EXPECT_EQ(dataset.stamp_ns(0), 5);
  EXPECT_TRUE(dataset.has_labels(0));
}

TEST(ScanDataset, ScalesTheIntensityOfAWholeDatasetTo0To1) {
  const ScratchFolder folder;
  (void)folder.file("0.pcd", pcd("51"));
  (void)folder.file("1.pcd", pcd("1"));
  const ScanDataset dataset(folder.path());
  EXPECT_FLOAT_EQ(dataset.read(0).scan.intensity.at(0), 0.2F);
  EXPECT_FLOAT_EQ(dataset.read(1).scan.intensity.at(0), 1.0F / 255.0F);
}

TEST(ScanDataset, ACutOutOfASequenceKeepsItsTimesAndPoses) {
  const ScratchFolder folder;
  std::filesystem::create_directories(folder.path() / "velodyne");
  write_kitti_bin(folder.path() / "velodyne" / "000002.bin", small_scan(1, 0));
  write_kitti_bin(folder.path() / "velodyne" / "000003.bin", small_scan(1, 0));
  write_kitti_times_ns(folder.path() / "times.txt", std::vector<std::int64_t>{10, 11, 12, 13});
  std::vector<Eigen::Isometry3d> poses;
  for (int k = 0; k < 4; ++k) poses.push_back(pose_at(k, 0.0));
  write_poses(folder.path() / "poses_lidar.txt", poses);
  const ScanDataset dataset(folder.path());
  EXPECT_EQ(dataset.stamp_ns(0), 12);
  EXPECT_NEAR(dataset.truth()->at(1).T_map_lidar.translation().x(), 3.0, 1e-9);

  // Files with one line a scan belong to the scans in order.
  write_kitti_times_ns(folder.path() / "times.txt", std::vector<std::int64_t>{70, 80});
  EXPECT_EQ(ScanDataset(folder.path()).stamp_ns(1), 80);
  write_kitti_times_ns(folder.path() / "times.txt", std::vector<std::int64_t>{70});
  EXPECT_THAT(
      message_of<DatasetError>([&] { ScanDataset{folder.path()}; }),
      AllOf(HasSubstr("times.txt"), HasSubstr("1 lines"), HasSubstr("scan 000003 needs line 4")));
}

TEST(ScanDataset, OneDamagedScanLeavesTheOthersReadable) {
  const ScratchFolder folder;
  (void)folder.file("0.pcd", pcd());
  (void)folder.file("1.pcd", "DATA");
  (void)folder.file("2.pcd", pcd());
  const ScanDataset dataset(folder.path());
  EXPECT_THROW((void)dataset.read(1), DatasetError);
  EXPECT_EQ(dataset.read(2).scan.size(), 1U);
}

/// As a lidar sees it whose rings count from the top.
Scan ringed_scan(const SensorModel& sensor, int first_ring, std::int64_t stamp_ns) {
  Scan scan;
  scan.stamp_ns = stamp_ns;
  for (int ring = first_ring; ring < sensor.rings; ++ring) {
    const double elevation = sensor.beam_elevation(ring);
    for (int column = 0; column < 200; ++column) {
      const double azimuth = 2.0 * std::numbers::pi * column / 200.0;
      const Eigen::Vector3d direction(std::cos(elevation) * std::cos(azimuth),
                                      std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      scan.points_lidar.push_back((10.0 * direction).cast<float>());
      scan.ring.push_back(static_cast<std::uint16_t>(ring));
      scan.intensity.push_back(0.5F);
    }
  }
  return scan;
}

TEST(ScanDataset, APartialFirstScanAndADamagedOneDoNotDecideWhichSensorItWas) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path() / "sequence");
  for (int i = 0; i < 6; ++i) {
    writer.add(ringed_scan(hdl_32e(), i == 0 ? 22 : 0, 100 * i), {}, pose_at(i, 0.0));
  }
  EXPECT_EQ(ScanDataset(folder.path() / "sequence").suggested_sensor().name, "HDL-32E");
  std::filesystem::resize_file(folder.path() / "sequence/velodyne/000000.bin", 7);
  const ScanDataset dataset(folder.path() / "sequence");
  EXPECT_EQ(dataset.suggested_sensor().name, "HDL-32E");
  EXPECT_THROW((void)dataset.read(0), DatasetError);
  EXPECT_EQ(dataset.read(1).scan.ring.size(), 6400U);
  for (int i = 1; i < 6; ++i) {
    std::filesystem::resize_file(
        folder.path() / "sequence/velodyne" / ("00000" + std::to_string(i) + ".bin"), 7);
  }
  EXPECT_THROW(ScanDataset(folder.path() / "sequence"), DatasetError);
}

TEST(ScanDataset, CountsTheRingsOfAScanOfFewPointsFromTheFirstThatItHas) {
  const ScratchFolder folder;
  Scan few;
  const Scan whole = ringed_scan(vlp_16(), 0, 0);
  for (std::size_t i = 0; i < whole.size(); i += 7) {
    few.points_lidar.push_back(whole.points_lidar[i]);
    few.ring.push_back(static_cast<std::uint16_t>(whole.ring[i] + 1));
    few.intensity.push_back(0.5F);
  }
  ASSERT_LT(few.size(), 1000U) << "else the elevations tell the sensor";
  KittiSequenceWriter(folder.path() / "sequence").add(few, {}, pose_at(0, 0.0));
  EXPECT_EQ(ScanDataset(folder.path() / "sequence").suggested_sensor().name, "VLP-16");
}

TEST(ScanDataset, FilesAsKittisWithoutRingsAreOfTheLidarThatTheirPointsTell) {
  const ScratchFolder folder;
  const auto suggested = [&](Scan scan) {
    write_kitti_bin(folder.path() / "000000.bin", scan);
    return ScanDataset(folder.path()).suggested_sensor();
  };
  EXPECT_EQ(suggested(ringed_scan(hdl_32e(), 0, 0)).name, "HDL-32E");
  EXPECT_EQ(suggested(ringed_scan(vlp_16(), 0, 0)).name, "VLP-16");
  EXPECT_EQ(suggested(ringed_scan(hdl_64e(), 0, 0)).name, "HDL-64E");

  // Points of KITTI, which show no rings to speak of; all, and without the ground.
  Scan kitti, above_ground, livox;
  for (int i = 0; i < 20'000; ++i) {
    const double share = i / 20'000.0;
    const auto point = [&](double low_deg, double high_deg) {
      const double elevation = (low_deg + share * (high_deg - low_deg)) * std::numbers::pi / 180.0;
      return Eigen::Vector3f(
          (10.0 * Eigen::Vector3d(std::cos(elevation), 0.0, std::sin(elevation))).cast<float>());
    };
    kitti.points_lidar.push_back(point(-24.5, 2.5));
    above_ground.points_lidar.push_back(point(-8.0, 2.5));
    livox.points_lidar.push_back(point(-36.0, 35.0));
  }
  for (Scan* scan : {&kitti, &above_ground, &livox}) scan->intensity.assign(scan->size(), 0.5F);
  EXPECT_EQ(suggested(kitti).name, "HDL-64E");
  EXPECT_EQ(suggested(above_ground).name, "HDL-64E");
  EXPECT_EQ(suggested(livox).pattern, ScanPattern::irregular);

  // KITTI's files have no times of points.
  std::filesystem::create_directories(folder.path() / "timed/velodyne");
  std::filesystem::create_directories(folder.path() / "timed/time_offsets");
  write_kitti_bin(folder.path() / "timed/velodyne/000000.bin", above_ground);
  write_values<float>(folder.path() / "timed/time_offsets/000000.bin",
                      std::vector<float>(above_ground.size(), 0.01F));
  EXPECT_EQ(ScanDataset(folder.path() / "timed").suggested_sensor().pattern,
            ScanPattern::irregular);
}

TEST(ScanDataset, FaultsSayWhatToDo) {
  const ScratchFolder folder;
  const auto message = [](const std::filesystem::path& path) {
    return message_of<DatasetError>([&] { ScanDataset{path}; });
  };
  EXPECT_THAT(message(folder.path() / "nowhere"), HasSubstr("check the path"));
  EXPECT_THAT(message(folder.path()), HasSubstr("no .bin, .pcd or .ply"));
  EXPECT_THAT(message(folder.file("a.txt", "x")), HasSubstr("no dataset"));
  std::filesystem::create_directories(folder.path() / "velodyne");
  EXPECT_THAT(message(folder.path()), HasSubstr("velodyne"));
}

TEST(ScanDataset, CameraPosesWithoutCalibrationAreAnError) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path());
  writer.add(small_scan(1, 0), {}, pose_at(0, 0));
  writer.finish();
  std::filesystem::remove(folder.path() / "calib.txt");
  const ScanDataset dataset(folder.path());
  EXPECT_THAT(
      message_of<CameraUnknownError>([&] { (void)dataset.truth(); }),
      AllOf(HasSubstr("calib.txt"), HasSubstr("camera frame"), HasSubstr("poses_lidar.txt")));
}

TEST(ScanDataset, LabelsOfAnotherScanAreRefused) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path());
  for (int k = 0; k < 2; ++k) {
    writer.add(small_scan(2, k), std::vector<std::uint32_t>(2), pose_at(0, 0));
  }
  writer.finish();
  (void)folder.file("labels/000001.label", std::string(12, '\0'));
  (void)folder.file("rings/000000.bin", std::string(2, '\0'));
  EXPECT_THAT(message_of<DatasetError>([&] { ScanDataset{folder.path()}; }),
              AllOf(HasSubstr("rings"), HasSubstr("1 values"), HasSubstr("2 points")));
  std::filesystem::remove_all(folder.path() / "rings");
  EXPECT_THROW((void)ScanDataset(folder.path()).read(1), DatasetError);
}

TEST(KittiSequenceWriter, AScanThatCannotBeWrittenLeavesThoseBeforeItComplete) {
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path());
  for (int k = 0; k < 2; ++k)
    writer.add(small_scan(2, k), std::vector<std::uint32_t>(2), pose_at(k, 0));
  std::filesystem::create_directories(folder.path() / "labels/000002.label");
  EXPECT_THROW(writer.add(small_scan(2, 2), std::vector<std::uint32_t>(2), pose_at(2, 0)),
               DatasetWriteError);
  const ScanDataset dataset(folder.path());
  ASSERT_EQ(dataset.size(), 2U);
  ASSERT_TRUE(dataset.truth().has_value());
  EXPECT_EQ(dataset.truth()->back().stamp_ns, 1);
}

TEST(ScanDataset, NamesTheScanAndTheLineThatATextFileLacks) {
  const ScratchFolder folder;
  for (const char* scan : {"velodyne/000026.bin", "velodyne/000027.bin", "velodyne/000028.bin"})
    write_kitti_bin(folder.file(scan, ""), small_scan(2, 0));
  std::string times;
  for (int line = 0; line < 12; ++line) times += "0." + std::to_string(10 + line) + "\n";
  (void)folder.file("times.txt", times);
  EXPECT_THAT(
      message_of<DatasetError>([&] { ScanDataset{folder.path()}; }),
      AllOf(HasSubstr("times.txt"), HasSubstr("12 lines"), HasSubstr("scan 000028 needs line 29")));
}

TEST(ScanDataset, TakesNoPointAtInfinityForOneOfTheFieldOfView) {
  const ScratchFolder folder;
  Scan few = ringed_scan(vlp_16(), 0, 0);
  few.points_lidar.resize(800);
  few.points_lidar.insert(few.points_lidar.end(), 100, {INFINITY, -INFINITY, INFINITY});
  few.intensity.assign(few.size(), 0.5F);
  for (const char* name : {"velodyne", "time_offsets"})
    std::filesystem::create_directories(folder.path() / name);
  write_kitti_bin(folder.path() / "velodyne/000000.bin", few);
  write_values<float>(folder.path() / "time_offsets/000000.bin",
                      std::vector<float>(few.size(), 0.01F));
  EXPECT_EQ(ScanDataset(folder.path()).suggested_sensor().name, "VLP-16");
}

TEST(ScanDataset, SaysFromWhichFieldsAScanIsAndThatItMadeUpStamps) {
  const ScratchFolder folder;
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\n"
      "property float z\nproperty float scalar_Intensity\nproperty float scalar_ring\n"
      "property double scalar_Time\nproperty uchar brightness\nend_header\n"
      "1 2 3 0.5 3 0.01 255\n4 5 6 0.25 7 0.02 0\n";
  (void)folder.file("a.ply", ply);
  (void)folder.file("b.ply", ply);
  const ScanDataset dataset(folder.path());
  const Scan scan = dataset.read(0).scan;
  EXPECT_THAT(scan.intensity, ElementsAre(0.5F, 0.25F));
  EXPECT_THAT(scan.ring, ElementsAre(3, 7));
  EXPECT_EQ(scan.time_offset_s.size(), 2U);
  EXPECT_THAT(dataset.remarks(),
              ElementsAre(AllOf(HasSubstr("intensity from scalar_Intensity (float32)"),
                                HasSubstr("time from scalar_Time (float64"),
                                HasSubstr("ring from scalar_ring (float32)")),
                          AllOf(HasSubstr("a.ply"), HasSubstr("ten scans a second"))));
  PointFieldNames named;
  named.intensity = {"brightness"};
  named.time = {"absent"};
  const ScanDataset other(folder / "a.ply", {}, named);
  EXPECT_THAT(other.read(0).scan.intensity, ElementsAre(1.0F, 0.0F));
  EXPECT_TRUE(other.read(0).scan.time_offset_s.empty());
  EXPECT_THAT(other.remarks(),
              ElementsAre(HasSubstr("intensity from brightness (uint8), no time")));
}

TEST(ScanDataset, TakesTheKindThatAFolderHasMostOfInWhateverLetters) {
  const ScratchFolder folder;
  for (const char* name : {"1.PCD", "2.pcd"}) (void)folder.file(name, pcd());
  (void)folder.file("extrinsics.bin", std::string(64, '\0'));
  const ScanDataset dataset(folder.path());
  EXPECT_THAT(names_of(dataset), ElementsAre("1.PCD", "2.pcd"));
  EXPECT_EQ(dataset.read(0).scan.size(), 1U);
}

}  // namespace
}  // namespace stillmap
