#include "core/label_synchronizer.hpp"

#include <algorithm>
#include <utility>

namespace stillmap {
namespace {

bool nothing_propagated(const PropagatedLabels& propagated) {
  return std::ranges::all_of(propagated.origin,
                             [](LabelOrigin origin) { return origin == LabelOrigin::none; });
}

void enter(const LabelledScan& labelled, const Eigen::Isometry3d& T_map_lidar, bool waits,
           LendableMap& map) {
  if (waits) return map.let_wait(labelled, T_map_lidar);
  map.insert(labelled, T_map_lidar);
}

void enter_propagated(const LabelledScan& labelled, const LabelSynchronizer::Labels& labels,
                      const Eigen::Isometry3d& T_map_lidar, bool waits, LendableMap& map) {
  LabelledScan known{labelled.scan, labels.evidence, labelled.motion};
  // A point without a class may be a moving object that has just come into sight: it makes no
  // voxel.
  for (std::size_t i = 0; i < known.motion.size(); ++i) {
    if (known.label(i) == SemanticClass::unlabeled) known.motion[i] = Motion::highly_dynamic;
  }
  enter(known, T_map_lidar, waits, map);
}

}  // namespace

LabelSynchronizer::LabelSynchronizer(std::unique_ptr<SegmentationPipeline> segmentation,
                                     const SensorModel& sensor)
    : segmentation_(std::move(segmentation)), sensor_(sensor) {}

LabelSynchronizer::Submission LabelSynchronizer::submit(const Scan& scan, LendableMap& map) {
  SegmentationPipeline::Output output = segmentation_->submit(scan);
  Submission submission{.own = std::nullopt, .pending = output.pending};
  for (auto& [stamp_ns, labels] : output.finished) {
    if (stamp_ns == scan.stamp_ns) {
      submission.own = std::move(labels);
    } else {
      insert_late_labels(stamp_ns, std::move(labels), map);
    }
  }
  return submission;
}

void LabelSynchronizer::insert_late_labels(std::int64_t stamp_ns, PointLabels labels,
                                           LendableMap& map) {
  const auto found = std::ranges::find(pending_, stamp_ns, &Scanned::stamp_ns);
  if (found == pending_.end()) return;
  Scanned late = std::move(*found);
  pending_.erase(found);
  // The network failed: its movers cannot be told from what stands still.
  if (labels.empty()) return;
  LabelledScan& labelled = late.posed.labelled;
  labelled.labels = std::move(labels);
  // Motion was classified without these labels: movable points count as semi-static at most, which
  // makes no voxels.
  for (std::size_t i = 0; i < labelled.motion.size(); ++i) {
    const bool movable = is_movable(labelled.label(i));
    if (labelled.motion[i] == Motion::highly_dynamic && movable) continue;
    labelled.motion[i] = movable ? Motion::semi_static : Motion::stationary;
  }
  enter(labelled, late.posed.T_map_lidar, late.waits, map);
  // Several networks at work end in any order. A clock that was set back makes no scan older.
  constexpr std::int64_t max_overtaking_ns = 5'000'000'000;
  const std::int64_t older_ns = last_labelled_ ? last_labelled_->stamp_ns() - stamp_ns : 0;
  if (older_ns <= 0 || older_ns > max_overtaking_ns) remember_labelled(std::move(late));
}

LabelSynchronizer::Labels LabelSynchronizer::labels_for(
    const Scan& scan, Submission submission, const Eigen::Isometry3d& T_map_lidar_predicted,
    const StaticMap* map) {
  Labels labels;
  labels.pending = submission.pending;
  if (submission.own && (!submission.own->empty() || !segmentation_->may_skip_scans())) {
    labels.provenance = submission.own->empty() ? LabelProvenance::none : LabelProvenance::fresh;
    labels.labels = *std::move(submission.own);
    return labels;
  }
  if (last_labelled_ && !last_labelled_image_) {
    const auto& [last, T_map_lidar_last] = last_labelled_->posed;
    last_labelled_image_.emplace(last.scan, last.labels, T_map_lidar_last, sensor_);
  }
  PropagatedLabels propagated =
      propagate_labels(scan, T_map_lidar_predicted, map, last_labelled_image_);
  if (nothing_propagated(propagated)) return labels;
  labels.provenance = LabelProvenance::propagated;
  labels.evidence = new_evidence(propagated);
  labels.labels = std::move(propagated.labels);
  return labels;
}

void LabelSynchronizer::insert(const LabelledScan& labelled, const Labels& labels,
                               const Eigen::Isometry3d& T_map_lidar, bool waits, LendableMap& map) {
  if (labels.pending) {
    if (pending_.size() == max_pending) pending_.pop_front();
    pending_.push_back({{labelled, T_map_lidar}, waits});
    return;
  }
  if (labels.provenance == LabelProvenance::propagated)
    return enter_propagated(labelled, labels, T_map_lidar, waits, map);
  // While labels of another scan are pending, a scan without any stays out: its moving objects
  // cannot be told from what stands still.
  if (labels.provenance == LabelProvenance::none && !pending_.empty()) return;
  enter(labelled, T_map_lidar, waits, map);
  if (labels.provenance == LabelProvenance::fresh && segmentation_->may_skip_scans()) {
    remember_labelled({{labelled, T_map_lidar}, waits});
  }
}

void LabelSynchronizer::decide_waiting(MapEntry entry) {
  if (entry == MapEntry::waits || entry == MapEntry::stays_out) return;
  if (entry == MapEntry::enters_with_waiting) {
    for (Scanned& pending : pending_) pending.waits = false;
    if (last_labelled_) last_labelled_->waits = false;
    return;
  }
  std::erase_if(pending_, [](const Scanned& pending) { return pending.waits; });
  if (!last_labelled_ || !last_labelled_->waits) return;
  last_labelled_.reset();
  last_labelled_image_.reset();
}

void LabelSynchronizer::remember_labelled(Scanned scanned) {
  last_labelled_ = std::move(scanned);
  last_labelled_image_.reset();
}

void LabelSynchronizer::correct(const MapCorrection& correction) {
  for (Scanned& scan : pending_) scan.posed.correct(correction);
  if (last_labelled_) last_labelled_->posed.correct(correction);
  last_labelled_image_.reset();
}

void LabelSynchronizer::reset() {
  pending_.clear();
  last_labelled_.reset();
  last_labelled_image_.reset();
}

}  // namespace stillmap
