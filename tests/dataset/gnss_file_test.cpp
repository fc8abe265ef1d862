#include "core/dataset/gnss_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::HasSubstr;

TEST(GnssFile, WhatIsWrittenComesBack) {
  const ScratchFolder folder;
  std::vector<GnssFix> fixes{{1'700'000'000'123'456'789, 49.123456789, -8.987654321, 115.25},
                             {1'700'000'000'323'456'789, -12.0, 179.5, std::nan("")}};
  fixes[0].covariance_enu = Eigen::Vector3d(0.04, 0.09, 1.0).asDiagonal();
  write_gnss_csv(folder / "gnss.csv", fixes);
  const std::vector<GnssFix> read = read_gnss_csv(folder / "gnss.csv");
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[0].stamp_ns, fixes[0].stamp_ns);
  EXPECT_NEAR(read[0].latitude_deg, fixes[0].latitude_deg, 1e-9);
  EXPECT_NEAR(read[0].longitude_deg, fixes[0].longitude_deg, 1e-9);
  EXPECT_NEAR(read[0].altitude_m, fixes[0].altitude_m, 1e-4);
  EXPECT_LT((read[0].covariance_enu - fixes[0].covariance_enu).norm(), 1e-6);
  EXPECT_TRUE(std::isnan(read[1].altitude_m));
}

TEST(GnssFile, NamesTheLineThatIsNoFix) {
  const ScratchFolder folder;
  const auto csv = folder.file("gnss.csv", "#stamp\n\n1,49,8,100,1,1,2\n2,49,8,100,1,1\n");
  EXPECT_THAT(message_of<DatasetError>([&] { (void)read_gnss_csv(csv); }),
              testing::AllOf(HasSubstr("line 4"), HasSubstr("standard deviations")));
  const auto words = folder.file("words.csv", "1,49,eight,100,1,1,2\n");
  EXPECT_THROW((void)read_gnss_csv(words), DatasetError);
  EXPECT_THROW((void)read_gnss_csv(folder / "none.csv"), DatasetError);
}

TEST(GnssFile, IsFoundBesideTheScans) {
  const ScratchFolder folder;
  (void)folder.file("a/velodyne/000000.bin", std::string(1600, '\0'));
  EXPECT_TRUE(ScanDataset(folder / "a").gnss().empty());
  (void)folder.file("a/gnss.csv", "5,49,8,100,1,1,2\n");
  EXPECT_EQ(ScanDataset(folder / "a").gnss().size(), 1U);
}

}  // namespace
}  // namespace stillmap
