#include "server/mapping/map_corrector.hpp"

#include <gtest/gtest.h>

#include <future>
#include <map>
#include <thread>

#include "core/segmentation/segmenter.hpp"
#include "tests/odometry/box_sequence.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap::server {
namespace {

const Eigen::Isometry3d T_new_old(Eigen::Translation3d(2.0, -1.0, 0.3));

/// Keeps what a checkpoint holds, and hands it out once it is released: so long a correction lasts.
class HeldStore : public TileStore {
 public:
  explicit HeldStore(const MapCheckpoint& checkpoint) {
    for (const auto& [id, record] : checkpoint.records) records_[id] = record;
  }
  void release() { release_.set_value(); }
  TileRecord load(TileId id) override {
    released_.wait();
    return records_.at(id);
  }

 private:
  std::map<TileId, TileRecord> records_;
  std::promise<void> release_;
  std::shared_future<void> released_{release_.get_future()};
};

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

  /// All tiles are only there from now on.
  std::shared_ptr<HeldStore> evict() {
    StaticMap& map = mapper_.static_map();
    const MapCheckpoint checkpoint = map.checkpoint(CheckpointScope::everything);
    auto store = std::make_shared<HeldStore>(checkpoint);
    map.use_tile_store(store);
    map.checkpoint_stored(checkpoint.step);
    EXPECT_GT(map.evict({5000.0, 0.0, 0.0}, 0), 0U);
    return store;
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
  const auto store = evict();
  corrector_.begin(correction());
  for (std::size_t kept = 0; kept < 20; ++kept) {
    EXPECT_FALSE(corrector_.take(false)) << kept;
    EXPECT_FALSE(corrector_.insert_kept([] { return true; }));
    map(1);
  }
  ASSERT_EQ(mapper_.kept_scans(), 20U);
  const std::jthread releases([&store] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    store->release();
  });
  const auto result = corrector_.take(false);
  ASSERT_TRUE(result && result->corrected);
  EXPECT_GT(result->corrected->moved_voxels, 0U);
  EXPECT_FALSE(corrector_.is_running());
  // Two at once, and while there is time.
  EXPECT_FALSE(corrector_.insert_kept([] { return false; }));
  EXPECT_EQ(mapper_.kept_scans(), 18U);
  EXPECT_TRUE(corrector_.insert_kept([] { return true; }));
  EXPECT_EQ(mapper_.kept_scans(), 0U);
}

TEST_F(MapCorrectorTest, InsertsScansThatWereConfirmedALittleAtATime) {
  LendableMap map({}, config().sensor);
  const auto posed = [this](std::size_t k) {
    const Scan& scan = sequence_.scans.at(k).scan;
    return LabelledScan{scan, {}, std::vector<Motion>(scan.size(), Motion::stationary)};
  };
  for (std::size_t k = 0; k < 6; ++k)
    map.let_wait(posed(k), test::level_pose(1.0 * static_cast<double>(k), 0, 0));
  EXPECT_EQ(map.decide_waiting(MapEntry::enters_with_waiting, true), 6U);
  EXPECT_TRUE(map.map().view()->tiles.empty());
  map.insert(posed(7), test::level_pose(7.0, 0, 0));
  EXPECT_EQ(map.kept_scans(), 0U) << "scans go on to enter the map";
  map.insert_confirmed(2);
  EXPECT_EQ(map.confirmed_scans(), 4U);
  static_cast<void>(map.lend());
  for (std::size_t k = 0; k < 3; ++k)
    map.let_wait(posed(k), test::level_pose(9.0 + static_cast<double>(k), 0, 0));
  EXPECT_EQ(map.decide_waiting(MapEntry::enters_with_waiting, false), 3U);
  map.reclaim();
  EXPECT_EQ(map.confirmed_scans(), 7U);
  map.insert_confirmed();
  EXPECT_EQ(map.confirmed_scans(), 0U);
}

TEST_F(MapCorrectorTest, ARefusedCorrectionMovesNothing) {
  map(5);
  const auto store = evict();
  store->release();
  MapCorrector refused(mapper_, 1);
  const Eigen::Isometry3d T_map_lidar = mapper_.trajectory().back().T_map_lidar;
  refused.begin(correction());
  map(1);
  const auto result = refused.take(true);
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->corrected);
  test::expect_near(mapper_.trajectory()[4].T_map_lidar, T_map_lidar, 1e-12, 1e-12);
  EXPECT_EQ(mapper_.kept_scans(), 1U);
}

}  // namespace
}  // namespace stillmap::server
