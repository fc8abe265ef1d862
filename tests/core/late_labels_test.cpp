// What the mapper makes of labels that come late, seldom or not at all.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>

#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "tests/odometry/box_sequence.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

using test::BoxSequence;

/// Takes every n-th scan and hands its labels in `delay` scans later.
class SlowSegmentation final : public SegmentationPipeline {
 public:
  SlowSegmentation(int every, int delay) : every_(every), delay_(delay) {}

  [[nodiscard]] std::string name() const override { return "slow"; }
  [[nodiscard]] bool may_skip_scans() const override { return true; }
  [[nodiscard]] Output submit(const Scan& scan) override {
    Output output;
    const int now = submitted_++;
    if (now % every_ == 0) {
      jobs_.push_back({now + delay_, {scan.stamp_ns, PassthroughSegmenter().segment(scan)}});
      output.pending = delay_ > 0;
    }
    while (!jobs_.empty() && jobs_.front().due <= now) {
      output.finished.push_back(jobs_.front().labels);
      jobs_.pop_front();
    }
    return output;
  }

 private:
  struct Job {
    int due;
    ScanLabels labels;
  };
  int every_;
  int delay_;
  int submitted_ = 0;
  std::deque<Job> jobs_;
};

/// Hands in empty labels, as after a failure.
class FailingSegmentation final : public SegmentationPipeline {
 public:
  [[nodiscard]] std::string name() const override { return "failing"; }
  [[nodiscard]] bool may_skip_scans() const override { return true; }
  [[nodiscard]] Output submit(const Scan& scan) override {
    return {.finished = {{scan.stamp_ns, {}}}, .pending = false};
  }
};

MapperConfig box_config() {
  MapperConfig config;
  config.sensor = test::test_lidar();
  return config;
}

const BoxSequence& traffic_sequence() {
  static const BoxSequence sequence(test::street_with_traffic(), 30);
  return sequence;
}

/// Share of the voxels that are of the class that most votes of a reference map give them.
/// Of voxels that several points hit: a single one has but the vote of its own scan.
double share_of_agreeing_voxels(const MapSnapshot& view, const MapSnapshot& reference) {
  std::size_t common = 0, agreeing = 0;
  for (const auto& tile : view.tiles) {
    const auto other = std::ranges::find(reference.tiles, tile->info.id,
                                         [](const auto& shared) { return shared->info.id; });
    if (other == reference.tiles.end()) continue;
    for (const Voxel& voxel : tile->voxels) {
      const auto same = std::ranges::lower_bound((*other)->voxels, voxel.index, {}, &Voxel::index);
      if (same == (*other)->voxels.end() || same->index != voxel.index) continue;
      if (voxel.point_count < 2) continue;
      ++common;
      agreeing += same->evidence.winner() == voxel.evidence.winner() ? 1U : 0U;
    }
  }
  return static_cast<double>(agreeing) / static_cast<double>(common);
}

/// Points whose label is the true one.
struct RightLabels {
  std::size_t right = 0;
  std::size_t points = 0;

  void add(const LabelledScan& labelled) {
    points += labelled.scan.size();
    for (std::size_t i = 0; i < labelled.scan.size(); ++i) {
      right += labelled.label(i) == labelled.scan.labels[i] ? 1U : 0U;
    }
  }
  [[nodiscard]] double share() const {
    return static_cast<double>(right) / static_cast<double>(points);
  }
};

struct Rhythm {
  int every;
  int delay;
  /// Share of right labels to be reached; the sequence is fast, and much of a scan is new ground.
  double right;
};

class LateLabels : public testing::TestWithParam<Rhythm> {};

TEST_P(LateLabels, MapAndPosesAreNearlyThoseOfLabelsInTime) {
  const auto [every, delay, right_share] = GetParam();
  RightLabels propagated;
  Mapper in_time(box_config(), std::make_unique<PassthroughSegmenter>());
  Mapper late(box_config(), std::make_unique<SlowSegmentation>(every, delay));
  for (std::size_t k = 0; k < traffic_sequence().scans.size(); ++k) {
    ASSERT_TRUE(in_time.process(traffic_sequence().scans[k].scan));
    const auto mapped = late.process(traffic_sequence().scans[k].scan);
    ASSERT_TRUE(mapped);
    test::expect_near(mapped->odometry.T_map_lidar, traffic_sequence().T_map_lidar[k], 0.2, 0.01);
    const bool fresh = delay == 0 && k % static_cast<std::size_t>(every) == 0;
    if (fresh) {
      EXPECT_EQ(mapped->label_provenance, LabelProvenance::fresh) << k;
    } else if (k >= static_cast<std::size_t>(every + delay)) {
      EXPECT_EQ(mapped->label_provenance, LabelProvenance::propagated) << k;
      propagated.add(mapped->labelled);
    }
  }
  EXPECT_GT(propagated.share(), right_share);
  const auto reference = in_time.map_snapshot(), view = late.map_snapshot();
  EXPECT_GT(view->tiles.voxel_count(), reference->tiles.voxel_count() * 7 / 10);
  // Without labels its rings begin by surfaces, with them by edges and planes: the same to a
  // centimetre or two.
  EXPECT_GT(share_of_agreeing_voxels(*view, *reference), 0.97);
  for (const auto& tile : view->tiles) {
    for (const Voxel& voxel : tile->voxels) ASSERT_FALSE(is_movable(voxel.evidence.winner()));
  }
}

INSTANTIATE_TEST_SUITE_P(Mapper, LateLabels,
                         testing::Values(Rhythm{1, 1, 0.9}, Rhythm{2, 0, 0.9}, Rhythm{3, 0, 0.87},
                                         Rhythm{3, 2, 0.83}, Rhythm{5, 4, 0.75}),
                         [](const auto& info) {
                           return "Every" + std::to_string(info.param.every) + "Late" +
                                  std::to_string(info.param.delay);
                         });

TEST(MapperLabels, PropagatedOnesCountLessThanFreshOnes) {
  Mapper mapper(box_config(), std::make_unique<SlowSegmentation>(2, 0));
  ASSERT_TRUE(mapper.process(traffic_sequence().scans[0].scan));
  const auto mapped = mapper.process(traffic_sequence().scans[1].scan);
  ASSERT_TRUE(mapped);
  ASSERT_EQ(mapped->label_provenance, LabelProvenance::propagated);
  for (const float confidence : mapped->labelled.labels.confidence) {
    ASSERT_LE(confidence, 0.5F);
  }
}

TEST(MapperLabels, ASegmentationThatFailsGivesPureGeometry) {
  Mapper mapper(box_config(), std::make_unique<FailingSegmentation>());
  for (std::size_t k = 0; k < 5; ++k) {
    const auto mapped = mapper.process(traffic_sequence().scans[k].scan);
    ASSERT_TRUE(mapped);
    EXPECT_EQ(mapped->label_provenance, LabelProvenance::none);
    EXPECT_TRUE(mapped->labelled.labels.empty());
    test::expect_near(mapped->odometry.T_map_lidar, traffic_sequence().T_map_lidar[k], 0.2, 0.02);
  }
  EXPECT_GT(mapper.map_snapshot()->tiles.voxel_count(), 1000U);
}

TEST(MapperLabels, ResetForgetsWhatWasPending) {
  Mapper mapper(box_config(), std::make_unique<SlowSegmentation>(2, 1));
  for (std::size_t k = 0; k < 3; ++k) ASSERT_TRUE(mapper.process(traffic_sequence().scans[k].scan));
  mapper.reset(5);
  // Only now the labels of scan 2 come.
  const auto mapped = mapper.process(traffic_sequence().scans[10].scan);
  ASSERT_TRUE(mapped);
  EXPECT_EQ(mapped->label_provenance, LabelProvenance::none);
}

}  // namespace
}  // namespace stillmap
