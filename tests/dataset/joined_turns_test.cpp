#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/dataset/kitti_files.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

/// A quarter, half or all of a round wall in eight rings, from an azimuth [degrees].
Scan wall(double from_deg, double width_deg) {
  Scan scan;
  for (std::uint16_t ring = 0; ring < 8; ++ring)
    for (double azimuth_deg = from_deg; azimuth_deg < from_deg + width_deg; azimuth_deg += 1.0) {
      const double azimuth = azimuth_deg * std::numbers::pi / 180.0;
      scan.points_lidar.emplace_back(static_cast<float>(12.0 * std::cos(azimuth)),
                                     static_cast<float>(12.0 * std::sin(azimuth)),
                                     2.0F - 0.5F * ring);
      scan.intensity.push_back(0.5F);
      scan.ring.push_back(ring);
    }
  return scan;
}

/// Clouds at 20 Hz, each a part of a turn after the last.
class Parts final : public ScanSource {
 public:
  Parts(std::size_t clouds, double width_deg, std::size_t lost = SIZE_MAX) : width_deg_(width_deg) {
    for (std::size_t i = 0; i < clouds; ++i)
      if (i != lost) numbers_.push_back(i);
  }
  [[nodiscard]] std::size_t size() const override { return numbers_.size(); }
  [[nodiscard]] std::filesystem::path name(std::size_t i) const override {
    return std::to_string(numbers_.at(i));
  }
  [[nodiscard]] std::int64_t stamp_ns(std::size_t i) const override {
    return static_cast<std::int64_t>(numbers_.at(i)) * 50'000'000;
  }
  [[nodiscard]] DatasetFrame read(std::size_t i) const override {
    DatasetFrame frame;
    frame.scan = wall(width_deg_ * static_cast<double>(numbers_.at(i)), width_deg_);
    frame.scan.stamp_ns = stamp_ns(i);
    if (labels_from_ <= numbers_.at(i)) frame.raw_labels.assign(frame.scan.size(), 50);
    return frame;
  }
  [[nodiscard]] std::optional<SensorModel> sensor() const override { return std::nullopt; }
  [[nodiscard]] bool is_of_one_frame() const override { return is_of_one_frame_; }

  std::size_t labels_from_ = SIZE_MAX;
  bool is_of_one_frame_ = true;

 private:
  double width_deg_;
  std::vector<std::size_t> numbers_;
};

TEST(JoinedTurns, AreTheScansOfARecordingOfParts) {
  const auto parts = std::make_shared<Parts>(40, 90.0);
  parts->labels_from_ = 0;
  ScanDataset dataset(parts);
  EXPECT_EQ(dataset.size(), 40U);
  dataset.join_turns();
  ASSERT_EQ(dataset.clouds_per_turn(), 4U);
  ASSERT_EQ(dataset.size(), 10U);
  EXPECT_EQ(dataset.stamp_ns(3), 600'000'000);
  EXPECT_EQ(dataset.file(3), "12");
  EXPECT_THAT(dataset.all_files(), SizeIs(40));
  const DatasetFrame frame = dataset.read(3);
  EXPECT_EQ(frame.scan.stamp_ns, 600'000'000);
  EXPECT_THAT(frame.scan.points_lidar, SizeIs(8 * 360));
  EXPECT_THAT(frame.scan.ring, SizeIs(8 * 360));
  EXPECT_THAT(frame.raw_labels, SizeIs(8 * 360));
  EXPECT_THAT(frame.scan.labels, SizeIs(8 * 360));
  EXPECT_FLOAT_EQ(frame.scan.time_offset_s.back(), 0.15F);
  EXPECT_TRUE(dataset.has_labels());
  EXPECT_THAT(dataset.remarks(), Contains(HasSubstr("4 clouds after another are joined")));
  EXPECT_THAT(dataset.remarks(), Not(Contains(HasSubstr("every second"))));
}

TEST(JoinedTurns, BeginAnewWhereACloudWasLost) {
  ScanDataset dataset(std::make_shared<Parts>(40, 180.0, 7));
  dataset.join_turns();
  ASSERT_EQ(dataset.clouds_per_turn(), 2U);
  ASSERT_EQ(dataset.size(), 20U);
  EXPECT_THAT(dataset.read(3).scan.points_lidar, SizeIs(8 * 180));
  EXPECT_EQ(dataset.stamp_ns(4), 400'000'000);
  EXPECT_THAT(dataset.read(4).scan.points_lidar, SizeIs(8 * 360));
}

TEST(JoinedTurns, AreNotMadeOfWholeOnesNorAgainstOrdersNorOfSeveralFrames) {
  ScanDataset whole(std::make_shared<Parts>(20, 360.0));
  whole.join_turns();
  EXPECT_EQ(whole.size(), 20U);
  const auto parts = std::make_shared<Parts>(20, 180.0);
  ScanDataset left(parts);
  left.join_turns(1);
  EXPECT_EQ(left.size(), 20U);
  EXPECT_THAT(left.remarks(), Contains(HasSubstr("clouds_per_turn")));
  ScanDataset told(std::make_shared<Parts>(20, 360.0));
  told.join_turns(2);
  EXPECT_EQ(told.size(), 10U);
  parts->is_of_one_frame_ = false;
  ScanDataset of_two(parts);
  of_two.join_turns();
  EXPECT_EQ(of_two.size(), 20U);
}

TEST(JoinedTurns, OfFilesHaveTheirFirstPartsPosesAndTenTurnsASecond) {
  const ScratchFolder folder;
  std::filesystem::create_directories(folder.path() / "velodyne");
  std::string poses;
  for (int k = 0; k < 12; ++k) {
    const std::string number = std::to_string(100000 + k);
    write_kitti_bin(folder.path() / "velodyne" / (number + ".bin"), wall(180.0 * k, 180.0));
    poses += "1 0 0 " + std::to_string(k) + " 0 1 0 0 0 0 1 0\n";
  }
  (void)folder.file("poses_lidar.txt", poses);
  ScanDataset dataset(folder.path());
  dataset.join_turns();
  ASSERT_EQ(dataset.size(), 6U);
  EXPECT_EQ(dataset.stamp_ns(1), 100'000'000);
  EXPECT_THAT(dataset.read(1).scan.points_lidar, SizeIs(8 * 360));
  const auto truth = dataset.truth();
  ASSERT_TRUE(truth);
  ASSERT_THAT(*truth, SizeIs(6));
  EXPECT_EQ(truth->at(2).stamp_ns, 200'000'000);
  EXPECT_DOUBLE_EQ(truth->at(2).T_map_lidar.translation().x(), 4.0);
}

TEST(JoinedTurns, OfManyFilesWithoutStampsAreFound) {
  const ScratchFolder folder;
  for (int k = 0; k < 130; ++k)
    write_kitti_bin(folder.path() / (std::to_string(100 + k) + ".bin"), wall(30.0 * k, 30.0));
  ScanDataset dataset(folder.path());
  dataset.join_turns();
  EXPECT_EQ(dataset.clouds_per_turn(), 12U);
  EXPECT_THAT(dataset.read(1).scan.points_lidar, SizeIs(8 * 360));
}

}  // namespace
}  // namespace stillmap
