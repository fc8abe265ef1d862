#include "core/label_synchronizer.hpp"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace stillmap {
namespace {

using enum SemanticClass;

constexpr std::int64_t period_ns = 100'000'000;
const Eigen::Vector3f place(10.0F, 0.0F, 0.0F);

/// Answers every submit() with the output that the test has set.
class ScriptedPipeline final : public SegmentationPipeline {
 public:
  explicit ScriptedPipeline(bool may_skip_scans) : may_skip_scans_(may_skip_scans) {}

  [[nodiscard]] std::string name() const override { return "scripted"; }
  [[nodiscard]] bool may_skip_scans() const override { return may_skip_scans_; }
  [[nodiscard]] Output submit(const Scan&) override { return std::exchange(next, {}); }

  Output next;

 private:
  bool may_skip_scans_;
};

Scan scan_at(std::int64_t number) {
  Scan scan;
  scan.stamp_ns = number * period_ns;
  scan.points_lidar.push_back(place);
  return scan;
}

PointLabels one_label(SemanticClass label) { return {{label}, {0.8F}}; }

/// A synchronizer beside its map, at rest in the origin.
class LabelSynchronizerTest : public testing::Test {
 protected:
  explicit LabelSynchronizerTest(bool may_skip_scans = true)
      : LabelSynchronizerTest(std::make_unique<ScriptedPipeline>(may_skip_scans)) {}

  /// Takes scan `number` all the way; the pipeline answers with `output`.
  LabelSynchronizer::Labels process(std::int64_t number, SegmentationPipeline::Output output,
                                    Motion motion = Motion::stationary, bool waits = false) {
    pipeline_.next = std::move(output);
    const Scan scan = scan_at(number);
    auto submission = synchronizer_.submit(scan, map_);
    auto labels =
        synchronizer_.labels_for(scan, std::move(submission), at_origin_, map_.readable());
    synchronizer_.insert({scan, labels.labels, {motion}}, labels, at_origin_, waits, map_);
    return labels;
  }

  [[nodiscard]] SemanticClass class_in_map() const {
    return map_.readable()->evidence_at(place.cast<double>()).winner();
  }
  [[nodiscard]] float weight_in_map() const {
    return map_.readable()->evidence_at(place.cast<double>()).votes().front().weight;
  }
  [[nodiscard]] std::size_t voxels_in_map() { return map_.map().view()->tiles.voxel_count(); }

  static SegmentationPipeline::Output finished(std::int64_t number, PointLabels labels,
                                               bool pending = false) {
    return {.finished = {{number * period_ns, std::move(labels)}}, .pending = pending};
  }
  static SegmentationPipeline::Output pending() { return {.finished = {}, .pending = true}; }

 private:
  explicit LabelSynchronizerTest(std::unique_ptr<ScriptedPipeline> pipeline)
      : pipeline_(*pipeline), synchronizer_(std::move(pipeline), hdl_64e()) {}

 protected:
  ScriptedPipeline& pipeline_;
  LabelSynchronizer synchronizer_;
  LendableMap map_{StaticMapConfig{.min_points = 1}, hdl_64e()};
  const Eigen::Isometry3d at_origin_ = Eigen::Isometry3d::Identity();
};

TEST_F(LabelSynchronizerTest, LabelsInTimeEnterTheMapWithTheirScan) {
  const auto labels = process(1, finished(1, one_label(road)));
  EXPECT_EQ(labels.provenance, LabelProvenance::fresh);
  EXPECT_FALSE(labels.unlabelled_may_move());
  EXPECT_EQ(class_in_map(), road);
}

TEST_F(LabelSynchronizerTest, APendingScanEntersTheMapWhenItsLabelsArrive) {
  const auto first = process(1, pending());
  EXPECT_EQ(first.provenance, LabelProvenance::none);
  EXPECT_TRUE(first.unlabelled_may_move());
  EXPECT_EQ(voxels_in_map(), 0U);
  const auto second = process(2, finished(1, one_label(road)));
  EXPECT_EQ(class_in_map(), road);
  EXPECT_EQ(second.provenance, LabelProvenance::propagated);
  EXPECT_EQ(second.labels.classes[0], road);
}

TEST_F(LabelSynchronizerTest, WhatIsPropagatedFromTheMapIsNoNewEvidence) {
  process(1, finished(1, one_label(road)));
  const auto labels = process(2, {});
  ASSERT_EQ(labels.provenance, LabelProvenance::propagated);
  EXPECT_GT(labels.labels.confidence[0], 0.0F);
  EXPECT_EQ(labels.evidence.confidence[0], 0.0F);
}

TEST_F(LabelSynchronizerTest, MovablePointsWithLateLabelsMakeNoVoxels) {
  process(1, pending());
  process(2, finished(1, one_label(car)));
  EXPECT_EQ(voxels_in_map(), 0U);
}

TEST_F(LabelSynchronizerTest, AScanWhoseLabelsFailLateStaysOut) {
  process(1, pending(), Motion::highly_dynamic);
  process(2, finished(1, {}, true));
  EXPECT_EQ(voxels_in_map(), 0U);
}

TEST_F(LabelSynchronizerTest, PointsWithoutAClassMakeNoVoxelsBesidePropagatedLabels) {
  process(1, finished(1, one_label(road)));
  const std::size_t voxels = voxels_in_map();
  pipeline_.next = {};
  Scan scan = scan_at(2);
  scan.points_lidar.emplace_back(-30.0F, 5.0F, 0.0F);
  const auto labels =
      synchronizer_.labels_for(scan, synchronizer_.submit(scan, map_), at_origin_, map_.readable());
  ASSERT_EQ(labels.labels.classes[1], unlabeled);
  synchronizer_.insert({scan, labels.labels, {Motion::stationary, Motion::stationary}}, labels,
                       at_origin_, false, map_);
  EXPECT_EQ(voxels_in_map(), voxels);
}

TEST_F(LabelSynchronizerTest, AMapThatIsLentIsNotAskedForLabels) {
  process(1, finished(1, one_label(road)));
  const float weight = weight_in_map();
  StaticMap& elsewhere = map_.lend();
  const auto labels = process(2, {});
  EXPECT_EQ(labels.provenance, LabelProvenance::propagated);
  EXPECT_EQ(labels.labels.classes[0], road);
  // By the last scan, and so new to the map, which has it only afterwards.
  EXPECT_GT(labels.evidence.confidence[0], 0.0F);
  EXPECT_EQ(elsewhere.evidence_at(place.cast<double>()).votes().front().weight, weight);
  map_.reclaim();
  map_.insert_kept();
  EXPECT_GT(weight_in_map(), weight);
}

TEST_F(LabelSynchronizerTest, ASourceThatFailsGivesPureGeometry) {
  const auto labels = process(1, finished(1, {}));
  EXPECT_EQ(labels.provenance, LabelProvenance::none);
  EXPECT_FALSE(labels.unlabelled_may_move());
  EXPECT_EQ(voxels_in_map(), 1U);
}

TEST_F(LabelSynchronizerTest, PureGeometryStaysOutWhileAnotherScanIsPending) {
  process(1, pending());
  process(2, finished(2, {}));
  EXPECT_EQ(voxels_in_map(), 0U);
}

TEST_F(LabelSynchronizerTest, SeveralScansWaitForTheirLabelsWhichComeInAnyOrder) {
  process(1, pending());
  process(2, pending());
  EXPECT_EQ(voxels_in_map(), 0U);
  process(3, finished(2, one_label(road), true));
  EXPECT_EQ(class_in_map(), road);
  const float weight = weight_in_map();
  process(4, finished(1, one_label(road), true));
  EXPECT_GT(weight_in_map(), weight);
}

TEST_F(LabelSynchronizerTest, OfTooManyPendingScansTheEarliestStaysOut) {
  constexpr auto count = static_cast<std::int64_t>(LabelSynchronizer::max_pending) + 1;
  for (std::int64_t number = 1; number <= count; ++number) process(number, pending());
  process(count + 1, finished(1, one_label(road), true));
  EXPECT_EQ(voxels_in_map(), 0U);
  process(count + 2, finished(count, one_label(road), true));
  EXPECT_EQ(class_in_map(), road);
}

TEST_F(LabelSynchronizerTest, AScanThatWaitsEntersTheMapWhenItIsDecidedAndLabelled) {
  process(1, pending(), Motion::stationary, true);
  process(2, pending(), Motion::stationary, true);
  // The first one's labels come before it is decided where it is, those of the second afterwards.
  process(3, finished(1, one_label(road), true), Motion::stationary, true);
  EXPECT_EQ(voxels_in_map(), 0U);
  synchronizer_.decide_waiting(MapEntry::enters_with_waiting);
  EXPECT_EQ(map_.decide_waiting(MapEntry::enters_with_waiting, false), 1U);
  EXPECT_EQ(class_in_map(), road);
  const float weight = weight_in_map();
  process(4, finished(2, one_label(road), true));
  EXPECT_GT(weight_in_map(), weight);
}

TEST_F(LabelSynchronizerTest, AScanThatHasWaitedForNothingIsForgottenWithItsLabels) {
  process(1, finished(1, one_label(road)), Motion::stationary, true);
  process(2, pending(), Motion::stationary, true);
  synchronizer_.decide_waiting(MapEntry::stays_out);
  EXPECT_EQ(map_.decide_waiting(MapEntry::stays_out, false), 0U);
  EXPECT_EQ(process(3, {}, Motion::stationary, true).provenance, LabelProvenance::propagated);
  for (const MapEntry entry : {MapEntry::stays_out_with_waiting, MapEntry::enters_with_waiting}) {
    synchronizer_.decide_waiting(entry);
    EXPECT_EQ(map_.decide_waiting(entry, false), 0U);
  }
  const auto labels = process(4, finished(2, one_label(road), true));
  EXPECT_EQ(labels.provenance, LabelProvenance::none) << "propagated from a place that is none";
  EXPECT_EQ(voxels_in_map(), 0U);
}

TEST_F(LabelSynchronizerTest, ResetForgetsThePendingAndTheLastLabelledScan) {
  process(1, finished(1, one_label(person)), Motion::highly_dynamic);
  process(2, pending());
  synchronizer_.reset();
  map_.map().reset(2);
  const auto labels = process(3, finished(2, one_label(road)));
  EXPECT_EQ(labels.provenance, LabelProvenance::none);
  EXPECT_EQ(class_in_map(), unlabeled);
}

class BlockingLabelSynchronizerTest : public LabelSynchronizerTest {
 protected:
  BlockingLabelSynchronizerTest() : LabelSynchronizerTest(false) {}
};

TEST_F(BlockingLabelSynchronizerTest, NothingIsPropagatedWhereNoScanIsSkipped) {
  process(1, finished(1, one_label(road)));
  ASSERT_EQ(class_in_map(), road);
  const auto labels = process(2, finished(2, {}));
  EXPECT_EQ(labels.provenance, LabelProvenance::none);
  EXPECT_TRUE(labels.labels.empty());
}

}  // namespace
}  // namespace stillmap
