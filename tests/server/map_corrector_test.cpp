#include "server/mapping/map_corrector.hpp"

#include <gtest/gtest.h>

#include "core/segmentation/segmenter.hpp"
#include "tests/odometry/box_sequence.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap::server {
namespace {

const Eigen::Isometry3d T_new_old(Eigen::Translation3d(2.0, -1.0, 0.3));

class MapCorrectorTest : public testing::Test {
 protected:
  static MapperConfig config() {
    MapperConfig config;
    config.sensor = test::test_lidar();
    return config;
  }
  void map(std::size_t scans) {
    for (std::size_t k = 0; k < scans; ++k)
      ASSERT_TRUE(mapper_.process(sequence_.scans.at(mapped_++).scan));
  }
  [[nodiscard]] MapCorrection correction() const {
    return MapCorrection({{.stamp_ns = mapper_.trajectory().front().stamp_ns,
                           .position_map = Eigen::Vector3d::Zero(),
                           .T_new_old = T_new_old}});
  }

  test::BoxSequence sequence_{test::street_with_traffic(), 30};
  std::size_t mapped_ = 0;
  Mapper mapper_{config(), std::make_unique<PassthroughSegmenter>()};
  MapCorrector corrector_{mapper_, std::numeric_limits<std::size_t>::max()};
};

TEST_F(MapCorrectorTest, CorrectsBesideTheScansThatCome) {
  map(5);
  EXPECT_FALSE(corrector_.take(true));
  const auto before = mapper_.map_snapshot();
  corrector_.begin(correction());
  ASSERT_TRUE(corrector_.is_running());
  map(3);
  EXPECT_EQ(mapper_.kept_scans(), 3U);
  const Eigen::Isometry3d T_map_lidar = mapper_.trajectory().back().T_map_lidar;
  const auto result = corrector_.take(true);
  ASSERT_TRUE(result && result->corrected && result->view);
  EXPECT_FALSE(corrector_.is_running());
  EXPECT_GT(result->corrected->moved_voxels, 0U);
  EXPECT_EQ(result->view->map_id, before->map_id);
  EXPECT_GT(result->view->version, before->version);
  test::expect_near(mapper_.trajectory().back().T_map_lidar, T_new_old * T_map_lidar, 1e-9, 1e-9);
}

TEST_F(MapCorrectorTest, WaitsWhereTheMapperWouldKeepTooManyScans) {
  map(5);
  corrector_.begin(correction());
  std::size_t kept = 0;
  for (std::size_t k = 0; k < 25 && corrector_.is_running(); ++k) {
    map(1);
    kept = std::max(kept, mapper_.kept_scans());
    static_cast<void>(corrector_.take(false));
  }
  EXPECT_FALSE(corrector_.is_running());
  EXPECT_LE(kept, 20U);
}

TEST_F(MapCorrectorTest, NobodyNeedsToTakeTheLastOne) {
  map(5);
  corrector_.begin(correction());
}

}  // namespace
}  // namespace stillmap::server
