#include "core/dataset/kitti_files.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/dataset/dataset_error.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::AllOf;
using testing::HasSubstr;

Eigen::Isometry3d random_pose(std::mt19937& random) {
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(any(random), any(random), any(random), any(random))
                      .normalized()
                      .toRotationMatrix();
  pose.translation() = 100.0 * Eigen::Vector3d(any(random), any(random), any(random));
  return pose;
}

TEST(KittiBin, RoundTripKeepsEveryBit) {
  const ScratchFolder folder;
  Scan scan;
  constexpr float inf = std::numeric_limits<float>::infinity();
  scan.points_lidar = {{1.25F, -2.5F, 3e-8F}, {-inf, 0.0F, 1e30F}};
  scan.intensity = {0.5F, 1.0F};
  write_kitti_bin(folder.path() / "a.bin", scan);
  EXPECT_EQ(std::filesystem::file_size(folder.path() / "a.bin"), 32U);
  const Scan back = read_kitti_bin(folder.path() / "a.bin");
  EXPECT_EQ(back.points_lidar, scan.points_lidar);
  EXPECT_EQ(back.intensity, scan.intensity);
  EXPECT_TRUE(back.ring.empty() && back.time_offset_s.empty() && back.labels.empty());
}

TEST(KittiBin, PassesNanOn) {
  const ScratchFolder folder;
  Scan scan;
  scan.points_lidar = {{std::nanf(""), 1.0F, 2.0F}};
  write_kitti_bin(folder.path() / "a.bin", scan);
  const Scan back = read_kitti_bin(folder.path() / "a.bin");
  EXPECT_TRUE(std::isnan(back.points_lidar.at(0).x()));
  EXPECT_EQ(back.intensity.at(0), 0.0F);
}

TEST(KittiBin, AnEmptyFileIsAnEmptyScan) {
  const ScratchFolder folder;
  EXPECT_TRUE(read_kitti_bin(folder.file("empty.bin", "")).empty());
}

TEST(KittiBin, ATruncatedFileIsNamedWithItsSize) {
  const ScratchFolder folder;
  const auto file = folder.file("cut.bin", std::string(37, 'x'));
  EXPECT_THAT(message_of<DatasetError>([&] { (void)read_kitti_bin(file); }),
              AllOf(HasSubstr("cut.bin"), HasSubstr("37"), HasSubstr("16"), HasSubstr("copy")));
}

TEST(KittiBin, AMissingFileAndAFolderAreErrors) {
  const ScratchFolder folder;
  EXPECT_THAT(message_of<DatasetError>([&] { (void)read_kitti_bin(folder.path() / "no.bin"); }),
              HasSubstr("no.bin"));
  EXPECT_THROW((void)read_kitti_bin(folder.path()), DatasetError);
  EXPECT_THROW(write_kitti_bin(folder.path() / "no" / "a.bin", Scan{}), DatasetError);
}

TEST(KittiLabels, RoundTripKeepsInstancesAndMovingIds) {
  const ScratchFolder folder;
  const std::vector<std::uint32_t> labels{10, (7U << 16U) | 252U, 0xFFFFFFFFU, 0};
  write_kitti_labels(folder.path() / "a.label", labels);
  EXPECT_EQ(read_kitti_labels(folder.path() / "a.label", 4), labels);
}

TEST(KittiLabels, OfAnotherScanAreRefused) {
  const ScratchFolder folder;
  write_kitti_labels(folder.path() / "a.label", std::vector<std::uint32_t>(3));
  EXPECT_THAT(
      message_of<DatasetError>([&] { (void)read_kitti_labels(folder.path() / "a.label", 4); }),
      AllOf(HasSubstr("a.label"), HasSubstr("3 labels"), HasSubstr("4 points")));
  EXPECT_THROW((void)read_kitti_labels(folder.file("b.label", "12345"), 1), DatasetError);
}

TEST(KittiLabels, AreReducedToTheNetworksClasses) {
  const std::vector<std::uint32_t> raw{(3U << 16U) | 252U, 40, 60, 99, 0};
  EXPECT_THAT(reduced_classes(raw),
              testing::ElementsAre(SemanticClass::car, SemanticClass::road, SemanticClass::road,
                                   SemanticClass::unlabeled, SemanticClass::unlabeled));
}

TEST(KittiPoses, RoundTripThroughTextAndThroughTheCameraFrame) {
  const ScratchFolder folder;
  std::mt19937 random(2);
  const Eigen::Isometry3d T_camera_lidar = random_pose(random);
  std::vector<Eigen::Isometry3d> T_lidar0_lidar;
  for (int i = 0; i < 20; ++i) T_lidar0_lidar.push_back(random_pose(random));

  write_kitti_calibration(folder.path() / "calib.txt", T_camera_lidar);
  write_poses(folder.path() / "poses.txt", camera_poses_from_lidar(T_lidar0_lidar, T_camera_lidar));
  const auto back = lidar_poses_from_camera(read_poses(folder.path() / "poses.txt"),
                                            read_kitti_calibration(folder.path() / "calib.txt"));
  ASSERT_EQ(back.size(), T_lidar0_lidar.size());
  for (std::size_t i = 0; i < back.size(); ++i) {
    EXPECT_LT((back[i].matrix() - T_lidar0_lidar[i].matrix()).norm(), 1e-8);
  }
}

TEST(KittiPoses, DrivingForwardIsZInTheCameraAndXInTheLidar) {
  Eigen::Isometry3d T_camera_lidar = Eigen::Isometry3d::Identity();
  T_camera_lidar.linear() << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  Eigen::Isometry3d T_camera0_camera = Eigen::Isometry3d::Identity();
  T_camera0_camera.translation() = Eigen::Vector3d(0.0, 0.0, 5.0);
  const auto lidar = lidar_poses_from_camera(std::vector{T_camera0_camera}, T_camera_lidar);
  EXPECT_LT((lidar.front().translation() - Eigen::Vector3d(5.0, 0.0, 0.0)).norm(), 1e-12);
}

TEST(KittiPoses, FaultsNameTheLine) {
  const ScratchFolder folder;
  const std::string good = "1 0 0 0 0 1 0 0 0 0 1 0\n";
  const auto message = [&](const std::string& line) {
    const auto file = folder.file("poses.txt", good + line + "\n" + good);
    return message_of<DatasetError>([&] { (void)read_poses(file); });
  };
  EXPECT_THAT(message("1 0 0"), AllOf(HasSubstr("poses.txt"), HasSubstr("line 2")));
  EXPECT_THAT(message("1 0 0 0 0 1 0 0 0 0 1 x"), HasSubstr("line 2"));
  EXPECT_THAT(message("1 0 0 0 0 1 0 0 0 0 1 nan"), HasSubstr("line 2"));
  EXPECT_THAT(message("1 0 0 0 0 1 0 0 0 0 1 0 0"), HasSubstr("line 2"));
  EXPECT_THAT(message("1,0,0,0,0,1,0,0,0,0,1,0"), HasSubstr("line 2"));
  EXPECT_THAT(message("2 0 0 0 0 2 0 0 0 0 2 0"), HasSubstr("no rotation"));
  EXPECT_THAT(message("-1 0 0 0 0 1 0 0 0 0 1 0"), HasSubstr("no rotation"));
  EXPECT_THAT(message(""), HasSubstr("line 2"));
}

TEST(KittiPoses, AnEmptyFileHasNoPosesAndBlankLinesAtTheEndDoNotCount) {
  const ScratchFolder folder;
  EXPECT_TRUE(read_poses(folder.file("none.txt", "")).empty());
  EXPECT_EQ(read_poses(folder.file("one.txt", "1 0 0 0 0 1 0 0 0 0 1 +2.5\r\n\n \n")).size(), 1U);
}

TEST(KittiCalibration, WithoutTrSaysWhatIsMissing) {
  const ScratchFolder folder;
  const auto file = folder.file("calib.txt", "P0: 1 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_THAT(message_of<DatasetError>([&] { (void)read_kitti_calibration(file); }),
              AllOf(HasSubstr("calib.txt"), HasSubstr("Tr:")));
  EXPECT_THROW((void)read_kitti_calibration(folder.file("bad.txt", "Tr: 1 2 3\n")), DatasetError);
}

TEST(KittiTimes, RoundTripKeepsNanosecondsSince1970) {
  const ScratchFolder folder;
  const std::vector<std::int64_t> times_ns{0, 1, 103'735'900, 1'539'765'928'346'003'001, -5};
  write_kitti_times_ns(folder.path() / "times.txt", times_ns);
  EXPECT_EQ(read_kitti_times(folder.path() / "times.txt").times_ns, times_ns);
}

TEST(KittiTimes, AreInTheUnitInWhichALidarGoesRound) {
  const ScratchFolder folder;
  const auto times_of = [&](const std::string& text) {
    return read_kitti_times(folder.file("times.txt", text));
  };
  const std::vector<std::int64_t> from_zero{0, 100'000'000, 210'000'000};
  const std::vector<std::pair<std::string, TimesUnit>> same_times{
      {"0\n0.1\n0.21\n", TimesUnit::seconds},
      {"0\n100\n210\n", TimesUnit::milliseconds},
      {"0.0\n100.0\n210.0\n", TimesUnit::milliseconds},
      {"0\n100000\n210000\n", TimesUnit::microseconds},
      {"0\n100000000\n210000000\n", TimesUnit::nanoseconds}};
  for (const auto& [text, unit] : same_times) {
    const KittiTimes times = times_of(text);
    EXPECT_EQ(times.unit, unit) << text;
    EXPECT_EQ(times.times_ns, from_zero) << text;
  }
  const KittiTimes since_1970 = times_of("1539765928346003001\n1539765928446003001\n");
  EXPECT_EQ(since_1970.unit, TimesUnit::nanoseconds);
  EXPECT_EQ(since_1970.times_ns[0], 1'539'765'928'346'003'001);
  EXPECT_EQ(times_of("1539765928346\n1539765928446\n").times_ns[1], 1'539'765'928'446'000'000);
  EXPECT_EQ(times_of("0\n30\n60\n").unit, TimesUnit::seconds) << "of a scanner that is carried";
  EXPECT_EQ(times_of("0\n3600\n7200\n").times_ns[1], 3'600'000'000'000) << "of no unit's lidar";
  EXPECT_THROW((void)times_of("9223372036854775807\n7\n"), DatasetError);
}

TEST(KittiTimes, ThatDoNotGrowAreNone) {
  const ScratchFolder folder;
  for (const char* text : {"0\n0\n0\n", "3.0\n2.0\n1.0\n"})
    EXPECT_EQ(read_kitti_times(folder.file("times.txt", text)).unit, TimesUnit::none) << text;
  EXPECT_EQ(read_kitti_times(folder.file("times.txt", "0\n")).unit, TimesUnit::seconds);
}

TEST(KittiTimes, FaultsNameTheLine) {
  const ScratchFolder folder;
  const auto file = folder.file("times.txt", "0.0\n 1.0e-01 \r\nsoon\n");
  EXPECT_THAT(message_of<DatasetError>([&] { (void)read_kitti_times(file); }),
              AllOf(HasSubstr("times.txt"), HasSubstr("line 3")));
}

}  // namespace
}  // namespace stillmap
