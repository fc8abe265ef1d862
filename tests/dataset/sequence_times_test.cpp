#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "core/dataset/kitti_sequence_writer.hpp"
#include "core/dataset/scan_dataset.hpp"
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

}  // namespace
}  // namespace stillmap
