#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "tests/odometry/box_sequence.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

using test::BoxSequence;

Mapper box_mapper() {
  MapperConfig config;
  config.sensor = test::test_lidar();
  return {config, std::make_unique<PassthroughSegmenter>()};
}

const BoxSequence& sequence() {
  static const BoxSequence sequence(test::street_with_traffic(), 24);
  return sequence;
}

const Eigen::Isometry3d T_new_old = Eigen::Translation3d(3.0, -2.0, 0.5) *
                                    Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.1, 0, 1).normalized());

/// The map so far, moved as a whole.
MapCorrection of_all(const Mapper& mapper) {
  std::vector<MapCorrection::Pose> poses;
  for (const StampedPose& pose : mapper.trajectory())
    poses.push_back({pose.stamp_ns, pose.T_map_lidar.translation(), T_new_old});
  return MapCorrection(std::move(poses));
}

bool correct(Mapper& mapper, const MapCorrection& correction) {
  const bool is_corrected = mapper.lend_static_map().correct(correction).has_value();
  mapper.reclaim_static_map(is_corrected ? &correction : nullptr);
  return is_corrected;
}

TEST(CorrectedMapper, GoesOnInTheCorrectedMapAsItWouldHaveInTheOldOne) {
  Mapper old = box_mapper();
  Mapper corrected = box_mapper();
  for (std::size_t k = 0; k < sequence().scans.size(); ++k) {
    const auto a = old.process(sequence().scans[k].scan);
    const auto b = corrected.process(sequence().scans[k].scan);
    ASSERT_TRUE(a && b);
    const bool is_corrected = k >= 12;
    const Eigen::Isometry3d T_expected =
        is_corrected ? T_new_old * a->odometry.T_map_lidar : a->odometry.T_map_lidar;
    test::expect_near(b->odometry.T_map_lidar, T_expected, 0.002, 0.0002);
    test::expect_near(b->T_odom_lidar, a->odometry.T_map_lidar, 0.002, 0.0002);
    EXPECT_EQ(b->odometry.health, a->odometry.health) << k;
    if (k == 11) {
      ASSERT_TRUE(correct(corrected, of_all(corrected)));
      test::expect_near(corrected.trajectory().back().T_map_lidar,
                        T_new_old * old.trajectory().back().T_map_lidar, 1e-9, 1e-9);
    }
  }
  // The two maps show the same: nearly every voxel of the one lies on one of the other.
  const auto view = old.map_snapshot();
  std::size_t shown = 0;
  std::size_t met = 0;
  for (const auto& tile : view->tiles) {
    for (const Voxel& voxel : tile->voxels) {
      ++shown;
      const Eigen::Vector3d moved = T_new_old * voxel.mean_map.cast<double>();
      met += corrected.static_map().evidence_at(moved).winner() != SemanticClass::unlabeled ? 1 : 0;
    }
  }
  EXPECT_GT(static_cast<double>(met), 0.93 * static_cast<double>(shown));
  const auto size = static_cast<double>(corrected.map_snapshot()->tiles.voxel_count());
  EXPECT_NEAR(size, static_cast<double>(shown), 0.06 * static_cast<double>(shown));
}

TEST(CorrectedMapper, APriorIsOneInTheCorrectedMap) {
  Mapper mapper = box_mapper();
  for (std::size_t k = 0; k < 12; ++k) ASSERT_TRUE(mapper.process(sequence().scans[k].scan));
  ASSERT_TRUE(correct(mapper, of_all(mapper)));
  for (std::size_t k = 12; k < 20; ++k) {
    const Eigen::Isometry3d T_motion =
        sequence().T_map_lidar[k - 1].inverse() * sequence().T_map_lidar[k];
    const auto mapped =
        mapper.process(sequence().scans[k].scan, mapper.trajectory().back().T_map_lidar * T_motion);
    ASSERT_TRUE(mapped);
    test::expect_near(mapped->odometry.T_map_lidar, T_new_old * sequence().T_map_lidar[k], 0.2,
                      0.01);
  }
}

/// Voxels of `view` that `other` has in the same tile, too.
std::size_t voxels_in_both(const MapSnapshot& view, const MapSnapshot& other) {
  std::size_t met = 0;
  for (const auto& tile : view.tiles) {
    const auto there = other.tiles.find(tile->info.id);
    if (there == nullptr) continue;
    for (const Voxel& voxel : tile->voxels) {
      met += std::ranges::any_of(there->voxels, [&](const Voxel& known) {
        return known.index == voxel.index && known.point_count == voxel.point_count;
      });
    }
  }
  return met;
}

TEST(CorrectedMapper, ScansThatComeWhileTheMapIsLentEnterItAsThoseThatComeAfterwards) {
  Mapper waited = box_mapper();
  Mapper lent = box_mapper();
  std::optional<MapCorrection> correction;
  StaticMap* elsewhere = nullptr;
  for (std::size_t k = 0; k < sequence().scans.size(); ++k) {
    const auto a = waited.process(sequence().scans[k].scan);
    const auto b = lent.process(sequence().scans[k].scan);
    ASSERT_TRUE(a && b);
    test::expect_near(b->T_odom_lidar, a->T_odom_lidar, 1e-12, 1e-12);
    if (k > 11 && k <= 16) {
      EXPECT_EQ(lent.kept_scans(), k - 11);
      test::expect_near(T_new_old * b->odometry.T_map_lidar, a->odometry.T_map_lidar, 1e-9, 1e-9);
    }
    if (k == 11) {
      correction = of_all(lent);
      ASSERT_TRUE(correct(waited, *correction));
      elsewhere = &lent.lend_static_map();
    }
    if (k == 16) {
      ASSERT_TRUE(elsewhere->correct(*correction));
      lent.reclaim_static_map(&*correction);
    }
    if (k > 16) {
      EXPECT_EQ(lent.kept_scans(), k > 21 ? 0 : 23 - k);
      lent.insert_kept_scans(2);
      test::expect_near(b->odometry.T_map_lidar, a->odometry.T_map_lidar, 1e-9, 1e-9);
    }
  }
  for (std::size_t i = 0; i < waited.trajectory().size(); ++i) {
    test::expect_near(lent.trajectory()[i].T_map_lidar, waited.trajectory()[i].T_map_lidar, 1e-9,
                      1e-9);
  }
  const auto view = waited.map_snapshot();
  const auto voxels = static_cast<double>(view->tiles.voxel_count());
  EXPECT_GT(static_cast<double>(voxels_in_both(*view, *lent.map_snapshot())), 0.999 * voxels);
}

TEST(CorrectedMapper, WhereNothingWasMovedScansThatWereKeptEnterTheMapAsTheyAre) {
  Mapper undisturbed = box_mapper();
  Mapper lent = box_mapper();
  for (std::size_t k = 0; k < 12; ++k) {
    if (k == 4) static_cast<void>(lent.lend_static_map());
    ASSERT_TRUE(undisturbed.process(sequence().scans[k].scan));
    ASSERT_TRUE(lent.process(sequence().scans[k].scan));
  }
  lent.reclaim_static_map(nullptr);
  EXPECT_EQ(lent.kept_scans(), 8U);
  lent.insert_kept_scans();
  EXPECT_EQ(lent.kept_scans(), 0U);
  const auto view = undisturbed.map_snapshot();
  EXPECT_EQ(voxels_in_both(*view, *lent.map_snapshot()), view->tiles.voxel_count());
}

TEST(CorrectedMapper, AnotherMapHasNoneOfTheScansThatWereKept) {
  Mapper mapper = box_mapper();
  for (std::size_t k = 0; k < 6; ++k) {
    if (k == 3) static_cast<void>(mapper.lend_static_map());
    ASSERT_TRUE(mapper.process(sequence().scans[k].scan));
  }
  mapper.reclaim_static_map(nullptr);
  mapper.reset(77);
  EXPECT_EQ(mapper.kept_scans(), 0U);
  mapper.insert_kept_scans();
  EXPECT_TRUE(mapper.map_snapshot()->tiles.empty());
}

TEST(CorrectedMapper, AnotherMapBeginsUncorrected) {
  Mapper mapper = box_mapper();
  for (std::size_t k = 0; k < 12; ++k) ASSERT_TRUE(mapper.process(sequence().scans[k].scan));
  ASSERT_TRUE(correct(mapper, of_all(mapper)));
  mapper.reset(77);
  const auto first = mapper.process(sequence().scans[0].scan);
  ASSERT_TRUE(first);
  test::expect_near(first->odometry.T_map_lidar, Eigen::Isometry3d::Identity(), 1e-9, 1e-9);
}

}  // namespace
}  // namespace stillmap
