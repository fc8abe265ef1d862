#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/kitti_sequence_writer.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "tests/dataset/kitti_lidar_scan.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::Contains;
using testing::HasSubstr;

/// A sequence of three scans with these lines in its times.txt.
ScanDataset sequence_with_times(const ScratchFolder& folder, const char* times) {
  KittiSequenceWriter writer(folder.path() / "sequence");
  for (std::int64_t k = 0; k < 3; ++k) {
    Scan scan;
    scan.stamp_ns = k;
    scan.points_lidar = {{1.0F, 2.0F, 3.0F}};
    scan.intensity = {0.5F};
    writer.add(scan, {}, Eigen::Isometry3d::Identity());
  }
  writer.finish();
  std::ofstream(folder.path() / "sequence" / "times.txt") << times;
  return ScanDataset(folder.path() / "sequence");
}

TEST(ScanDatasetTimes, AreMadeUpWhereThoseOfTheFileDoNotGrow) {
  const ScratchFolder folder;
  const ScanDataset dataset = sequence_with_times(folder, "0.0\n0.0\n0.0\n");
  EXPECT_EQ(dataset.stamp_ns(2), 200'000'000);
  EXPECT_THAT(dataset.remarks(), Contains(HasSubstr("times.txt do not grow")));
}

TEST(ScanDatasetTimes, InAnotherUnitAreTold) {
  const ScratchFolder folder;
  const ScanDataset dataset = sequence_with_times(folder, "5000\n5100\n5200\n");
  EXPECT_EQ(dataset.stamp_ns(0), 5'000'000'000);
  EXPECT_EQ(dataset.stamp_ns(2), 5'200'000'000);
  EXPECT_THAT(dataset.remarks(), Contains(HasSubstr("milliseconds")));
}

/// A PCD of x y z, binary.
std::string pcd_of(const Scan& scan) {
  const std::string points = std::to_string(scan.size());
  std::string text = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " +
                     points + "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + points +
                     "\nDATA binary\n";
  for (const Eigen::Vector3f& p : scan.points_lidar)
    text.append(reinterpret_cast<const char*>(p.data()), 3 * sizeof(float));
  return text;
}

TEST(ScanDatasetUnits, ThatCanBeNoMetresAreTold) {
  for (const double factor : {1.0, 100.0, 1000.0}) {
    const ScratchFolder folder;
    Scan scan = test::draw({.is_uneven = false});
    for (Eigen::Vector3f& p : scan.points_lidar) p *= static_cast<float>(factor);
    (void)folder.file("0.pcd", pcd_of(scan));
    const auto told = Contains(HasSubstr("coordinates are taken for metres"));
    const std::vector<std::string> remarks = ScanDataset(folder.path()).remarks();
    if (factor > 1.0) {
      EXPECT_THAT(remarks, told) << factor;
    } else {
      EXPECT_THAT(remarks, testing::Not(told));
    }
  }
}

TEST(ScanDataset, TakesCoordinatesOfBinFilesToTheAxesThatNamesSay) {
  const ScratchFolder folder;
  (void)sequence_with_times(folder, "0.0\n0.1\n0.2\n");
  const std::filesystem::path sequence = folder.path() / "sequence";
  PointFieldNames names;
  names.y = {"-y"};
  // What we wrote has our axes, and keeps them.
  const ScanDataset written(sequence, {}, names);
  EXPECT_EQ(written.read(0).scan.points_lidar.front(), Eigen::Vector3f(1.0F, 2.0F, 3.0F));
  EXPECT_THAT(written.remarks(), Contains(HasSubstr("axes.txt says")));
  std::filesystem::remove(sequence / "axes.txt");
  const ScanDataset dataset(sequence, {}, names);
  EXPECT_EQ(dataset.read(0).scan.points_lidar.front(), Eigen::Vector3f(1.0F, -2.0F, 3.0F));
  EXPECT_THAT(dataset.remarks(), Contains(HasSubstr("y from -y")));
  names.y = {"left"};
  names.z = {"x"};
  EXPECT_THAT(message_of<DatasetError>([&] { (void)ScanDataset(sequence, {}, names); }),
              HasSubstr("take each of them once"));
}

// Points that stand still in the world do so after the axes are put right, too.
TEST(ScanDataset, TakesTruePosesToTheAxesThatNamesSay) {
  PointFieldNames turned, mirrored;
  turned.y = {"-y"};
  turned.z = {"-z"};
  mirrored.y = {"-y"};
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  T_map_lidar.translation() = Eigen::Vector3d(3.0, 1.0, 0.5);
  T_map_lidar.rotate(Eigen::AngleAxisd(0.4, Eigen::Vector3d(0.1, 0.2, 1.0).normalized()));
  const Eigen::Vector3d landmark(7.0, -2.0, 1.0);
  const ScratchFolder folder;
  KittiSequenceWriter writer(folder.path() / "sequence");
  for (const auto& T : {Eigen::Isometry3d::Identity(), T_map_lidar}) {
    Scan scan;
    scan.points_lidar = {(T.inverse() * landmark).cast<float>()};
    scan.intensity = {0.5F};
    writer.add(scan, {}, T);
  }
  writer.finish();
  std::filesystem::remove(folder.path() / "sequence/axes.txt");
  for (const PointFieldNames& names : {turned, mirrored}) {
    const ScanDataset dataset(folder.path() / "sequence", {}, names);
    const Trajectory truth = dataset.truth().value();
    EXPECT_NEAR(truth[1].T_map_lidar.linear().determinant(), 1.0, 1e-9);
    for (std::size_t i = 0; i < 2; ++i) {
      const Eigen::Vector3d point = dataset.read(i).scan.points_lidar.front().cast<double>();
      EXPECT_LT(
          (truth[i].T_map_lidar * point - dataset.read(0).scan.points_lidar.front().cast<double>())
              .norm(),
          1e-4);
    }
  }
}

TEST(ScanDataset, SaysWhatBecomesOfFilesOfOtherKinds) {
  const ScratchFolder folder;
  const auto fault = [&] {
    return message_of<DatasetError>([&] { (void)ScanDataset(folder.path()); });
  };
  EXPECT_THAT(fault(), testing::Not(HasSubstr("but")));
  (void)folder.file("0.npy", "numbers");
  (void)folder.file("1.npy", "numbers");
  (void)folder.file("a.txt", "notes");
  EXPECT_THAT(fault(), HasSubstr("but .npy; of scans in these, write x y z intensity as float32"));
}

TEST(ScanDataset, KnowsKittisLidarInFilesOfOtherKinds) {
  const ScratchFolder folder;
  const Scan drawn = test::draw({.way_m = 0.5});
  for (const char* name : {"0.pcd", "1.pcd"}) (void)folder.file(name, pcd_of(drawn));
  const ScanDataset dataset(folder.path());
  ASSERT_TRUE(dataset.kitti_lidar());
  EXPECT_EQ(dataset.read_uncorrected(1).scan.points_lidar, drawn.points_lidar);
  EXPECT_NE(dataset.read(1).scan.points_lidar, drawn.points_lidar);
}

}  // namespace
}  // namespace stillmap
