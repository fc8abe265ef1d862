#include "core/dataset/imu_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::HasSubstr;

TEST(ImuFile, WhatIsWrittenComesBack) {
  const ScratchFolder folder;
  const std::vector<ImuSample> samples{
      {1'700'000'000'123'456'789, {0.1, -0.2, 0.3}, {0.5, -9.5, 1e-7}},
      {1'700'000'000'128'456'789, {-0.1, 1.0 / 3.0, 0.0}, {0.0, 0.0, 9.81}}};
  write_imu_csv(folder / "imu.csv", samples);
  const std::vector<ImuSample> read = read_imu_file(folder / "imu.csv");
  ASSERT_EQ(read.size(), 2U);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(read[k].stamp_ns, samples[k].stamp_ns);
    EXPECT_LT((read[k].angular_velocity_imu - samples[k].angular_velocity_imu).norm(), 1e-8);
    EXPECT_LT((read[k].acceleration_imu - samples[k].acceleration_imu).norm(), 1e-7);
  }
}

TEST(ImuFile, TextHasSecondsAndAccelerationsFirst) {
  const ScratchFolder folder;
  const auto file =
      folder.file("imu.txt", "# a comment\n1.5 1 2 3 0.1 0.2 0.3\n\n2.25 4 5 6 nan 0 0\n");
  const std::vector<ImuSample> samples = read_imu_file(file);
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_EQ(samples[0].stamp_ns, 1'500'000'000);
  EXPECT_EQ(samples[0].acceleration_imu, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(samples[0].angular_velocity_imu, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_TRUE(std::isnan(samples[1].angular_velocity_imu.x()));
}

TEST(ImuFile, NamesTheLineThatIsNoSample) {
  const ScratchFolder folder;
  const auto csv = folder.file("imu.csv", "#stamp\n1,2,3,4,5,6,7\n2,3,4\n");
  EXPECT_THAT(message_of<DatasetError>([&] { (void)read_imu_file(csv); }),
              testing::AllOf(HasSubstr("line 3"), HasSubstr("EuRoC")));
  EXPECT_THROW((void)read_imu_file(folder / "none.csv"), DatasetError);
}

TEST(ImuFile, IsFoundBesideTheScans) {
  const ScratchFolder folder;
  (void)folder.file("a/1.bin", std::string(1600, '\0'));
  EXPECT_TRUE(ScanDataset(folder / "a").imu().empty());
  (void)folder.file("a/imu.txt", "0.5 0 0 9.8 0 0 0\n");
  EXPECT_EQ(ScanDataset(folder / "a").imu().size(), 1U);
  (void)folder.file("b/velodyne/000000.bin", std::string(1600, '\0'));
  (void)folder.file("b/imu.csv", "5,0,0,0,0,0,9.8\n6,0,0,0,0,0,9.8\n");
  EXPECT_EQ(ScanDataset(folder / "b").imu().size(), 2U);
}

}  // namespace
}  // namespace stillmap
