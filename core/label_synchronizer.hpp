#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "core/lendable_map.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/map/label_propagation.hpp"
#include "core/map/map_correction.hpp"
#include "core/segmentation_pipeline.hpp"

namespace stillmap {

/// Matches scans with labels that may arrive after them. It owns the segmentation pipeline and
/// decides which labels a scan is registered with (its own, else labels propagated from the map and
/// from the last labelled scan), and when and with which labels the scan enters the static map. The
/// labels of several scans may be on their way, and come in any order; where that are more than
/// max_pending, the earliest scan stays out of the static map. NOT thread safe.
class LabelSynchronizer {
 public:
  /// As many as a machine's cores may work on at a time; a scan takes some 5 MB.
  static constexpr std::size_t max_pending = 16;

  LabelSynchronizer(std::unique_ptr<SegmentationPipeline> segmentation, const SensorModel& sensor);

  /// Name of the label source, for the status.
  [[nodiscard]] std::string name() const { return segmentation_->name(); }
  /// See Segmenter.
  void set_mount(const Eigen::Isometry3d& T_base_lidar) { segmentation_->set_mount(T_base_lidar); }

  /// What the pipeline said when a scan was submitted.
  struct Submission {
    /// Labels of the submitted scan; empty ones where the source failed.
    std::optional<PointLabels> own;
    /// They will come later.
    bool pending = false;
  };

  /// Submits a prepared scan. An earlier scan whose labels have arrived since enters `map` with
  /// them.
  [[nodiscard]] Submission submit(const Scan& scan, LendableMap& map);

  /// The labels that a scan is registered with.
  struct Labels {
    LabelProvenance provenance = LabelProvenance::none;
    PointLabels labels;
    /// The part of propagated labels that does not come from the map itself, which alone counts as
    /// new evidence there.
    PointLabels evidence;
    bool pending = false;

    /// Whether points without a class may be moving objects that have just come into sight.
    [[nodiscard]] bool unlabelled_may_move() const {
      return provenance == LabelProvenance::propagated ||
             (provenance == LabelProvenance::none && pending);
    }
  };

  /// `scan` is the submitted one after motion compensation; the predicted pose places it in `map`,
  /// which may be null: then labels come from the last labelled scan alone.
  [[nodiscard]] Labels labels_for(const Scan& scan, Submission submission,
                                  const Eigen::Isometry3d& T_map_lidar_predicted,
                                  const StaticMap* map);

  /// Inserts a registered scan into `map`: with `labels` where they are final; a scan whose own
  /// labels are pending is kept until submit() receives them. `labelled` holds `labels.labels`. One
  /// that `waits` (MapEntry) does so in the map.
  void insert(const LabelledScan& labelled, const Labels& labels,
              const Eigen::Isometry3d& T_map_lidar, bool waits, LendableMap& map);
  /// What becomes of such scans, by the entry of the next one, whose labels are still to come.
  void decide_waiting(MapEntry entry);

  /// Moves the scans that it keeps.
  void correct(const MapCorrection& correction);

  /// Forgets all pending and the last labelled scan.
  void reset();

 private:
  void insert_late_labels(std::int64_t stamp_ns, PointLabels labels, LendableMap& map);
  /// A registered scan, and whether it waits.
  struct Scanned {
    PosedScan posed;
    bool waits = false;

    [[nodiscard]] std::int64_t stamp_ns() const { return posed.labelled.scan.stamp_ns; }
  };
  void remember_labelled(Scanned scanned);

  std::unique_ptr<SegmentationPipeline> segmentation_;
  SensorModel sensor_;
  /// The scans whose own labels are still to come, the earliest first.
  std::deque<Scanned> pending_;
  /// The newest scan with labels of its own; its range image is made when labels are first
  /// propagated from it.
  std::optional<Scanned> last_labelled_;
  std::optional<LabelledRangeImage> last_labelled_image_;
};

}  // namespace stillmap
