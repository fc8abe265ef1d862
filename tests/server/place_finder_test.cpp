#include "server/localization/place_finder.hpp"

#include <gtest/gtest.h>

#include "core/segmentation/segmenter.hpp"
#include "tests/odometry/box_sequence.hpp"

namespace stillmap::server {
namespace {

class PlaceFinderTest : public testing::Test {
 protected:
  PlaceFinderTest() {
    mapper_.reset(1);
    latest_map_.begin(mapper_.map_snapshot(), {});
  }

  static MapperConfig mapper_config() {
    MapperConfig config;
    config.sensor = test::test_lidar();
    return config;
  }
  /// Whether the next scan is handed out to be looked for.
  bool is_looked_for() {
    const std::size_t before = handed_out_;
    const Scan& scan = sequence_.scans.at(next_++).scan;
    EXPECT_FALSE(finder_.relocate(mapper_, scan.stamp_ns));
    EXPECT_TRUE(mapper_.process(scan));
    return handed_out_ > before;
  }

  test::BoxSequence sequence_{test::street_with_traffic(), 8};
  std::size_t next_ = 0;
  std::size_t handed_out_ = 0;
  Mapper mapper_{mapper_config(),
                 std::make_unique<PassthroughSegmenter>(),
                 {.stage_ended = {},
                  .pose_found = {},
                  .scan_prepared = [this](const Scan&, const PointLabels&) { ++handed_out_; }}};
  LatestMap latest_map_;
  Statistics statistics_;
  TileReader tiles_{nullptr};
  PlaceFinder finder_{ServerConfig{}, latest_map_, tiles_, statistics_};
};

TEST_F(PlaceFinderTest, ACorrectionOfTheMapDoesNotEndTheSearchThatSomebodyAskedFor) {
  EXPECT_FALSE(is_looked_for());
  finder_.look_near({.T_map_base = Eigen::Isometry3d::Identity(), .radius_m = 5.0});
  EXPECT_TRUE(is_looked_for());
  finder_.map_corrected();
  EXPECT_TRUE(is_looked_for());
  finder_.forget();
  EXPECT_FALSE(is_looked_for());
  finder_.map_corrected();
  EXPECT_FALSE(is_looked_for());
}

}  // namespace
}  // namespace stillmap::server
