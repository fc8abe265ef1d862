#include "core/mapper.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/lidar/rings.hpp"

namespace stillmap {
namespace {

/// The lidar sees farther than it moves until it is told of its surroundings again [m].
constexpr double prior_map_update_distance_m = 20.0;

}  // namespace

std::string MapperConfig::faults() const {
  return sensor.faults() + odometry.faults() + static_map.faults();
}

namespace {

MapperConfig checked(const MapperConfig& config) {
  if (const std::string faults = config.faults(); !faults.empty())
    throw std::invalid_argument(faults);
  return config;
}

}  // namespace

Mapper::Mapper(const MapperConfig& config, std::unique_ptr<Segmenter> label_source,
               MapperListeners listeners)
    : Mapper(config, std::make_unique<BlockingSegmenter>(std::move(label_source)),
             std::move(listeners)) {}

Mapper::Mapper(const MapperConfig& config, std::unique_ptr<SegmentationPipeline> segmentation,
               MapperListeners listeners)
    : config_(checked(config)),
      segmentation_(std::move(segmentation)),
      listeners_(std::move(listeners)),
      odometry_(config.odometry, config.sensor),
      static_map_(config.static_map) {}

std::optional<MappedScan> Mapper::process(
    Scan raw_scan, const std::optional<Eigen::Isometry3d>& T_map_lidar_prior) {
  if (!accepts(raw_scan)) return std::nullopt;

  // Beam of every point, then without points that are no measurements.
  raw_scan.ring = assign_rings(raw_scan, config_.sensor);
  Scan scan = drop_unusable_points(std::move(raw_scan), config_.prepare);
  if (!has_enough_points(scan)) return std::nullopt;
  end_stage("prepare");

  // Class of every point, if it is known in time.
  SegmentationPipeline::Output segmentation = segmentation_->submit(scan);
  auto own_labels = accept_finished_labels(std::move(segmentation.finished), scan.stamp_ns);
  if (config_.prepare.deskew)
    scan = deskew(std::move(scan), odometry_.motion_during(config_.sensor.period_s),
                  config_.sensor.period_s);
  const Eigen::Isometry3d T_map_lidar_expected =
      T_map_lidar_prior.value_or(odometry_.predict(scan.stamp_ns));
  Labels known = labels_for(scan, std::move(own_labels), T_map_lidar_expected);
  end_stage("segment");

  // Pose, and what moves.
  add_prior_map_near(T_map_lidar_expected.translation());
  Odometry::Step step = odometry_.register_scan(scan, known.labels, T_map_lidar_prior);
  end_stage("odometry");
  if (listeners_.pose_found) listeners_.pose_found(scan.stamp_ns, step.result);

  // The static map takes what stands still.
  MappedScan mapped{step.result,
                    known.label_provenance,
                    {std::move(scan), std::move(known.labels), std::move(step.motion)},
                    known.label_provenance == LabelProvenance::propagated ||
                        (known.label_provenance == LabelProvenance::none && segmentation.pending)};
  if (segmentation.pending) {
    pending_ = PosedScan{mapped.labelled, step.result.T_map_lidar};
  } else {
    insert(mapped, known.evidence);
  }
  trajectory_.push_back({mapped.labelled.scan.stamp_ns, step.result.T_map_lidar});
  end_stage("static_map");
  return mapped;
}

std::optional<PointLabels> Mapper::accept_finished_labels(std::vector<ScanLabels> finished,
                                                          std::int64_t stamp_ns) {
  std::optional<PointLabels> own;
  for (auto& [labelled_stamp_ns, labels] : finished) {
    if (labelled_stamp_ns == stamp_ns) {
      own = std::move(labels);
    } else if (pending_ && pending_->labelled.scan.stamp_ns == labelled_stamp_ns) {
      insert_late_labels(std::move(labels));
    }
  }
  return own;
}

Mapper::Labels Mapper::labels_for(const Scan& scan, std::optional<PointLabels> own,
                                  const Eigen::Isometry3d& T_map_lidar_predicted) {
  if (own && (!own->empty() || !segmentation_->may_skip_scans())) {
    const auto label_provenance = own->empty() ? LabelProvenance::none : LabelProvenance::fresh;
    return {label_provenance, *std::move(own), std::nullopt};
  }
  if (last_labelled_ && !last_labelled_image_) {
    const LabelledScan& last = last_labelled_->labelled;
    last_labelled_image_.emplace(last.scan, last.labels, last_labelled_->T_map_lidar,
                                 config_.sensor);
  }
  PropagatedLabels propagated =
      propagate_labels(scan, T_map_lidar_predicted, static_map_, last_labelled_image_);
  if (std::ranges::count(propagated.origin, LabelOrigin::none) == std::ssize(propagated.origin)) {
    return {};
  }
  PointLabels evidence = new_evidence(propagated);
  return {LabelProvenance::propagated, std::move(propagated.labels), std::move(evidence)};
}

void Mapper::insert(const MappedScan& mapped, const std::optional<PointLabels>& evidence) {
  const LabelledScan& labelled = mapped.labelled;
  const Eigen::Isometry3d& T_map_lidar = mapped.odometry.T_map_lidar;
  if (mapped.label_provenance == LabelProvenance::propagated) {
    LabelledScan known{labelled.scan, *evidence, labelled.motion};
    // What nobody knows may be a mover that came into sight: it makes no voxels.
    for (std::size_t i = 0; i < known.motion.size(); ++i) {
      if (known.label(i) == SemanticClass::unlabeled) known.motion[i] = Motion::highly_dynamic;
    }
    insert(known, T_map_lidar);
    return;
  }
  // Where labels are on their way, a scan without any is not worth the movers in it.
  if (mapped.label_provenance == LabelProvenance::none && pending_) return;
  insert(labelled, T_map_lidar);
  if (mapped.label_provenance == LabelProvenance::fresh && segmentation_->may_skip_scans()) {
    last_labelled_ = PosedScan{labelled, T_map_lidar};
    last_labelled_image_.reset();
  }
}

void Mapper::insert(const LabelledScan& labelled, const Eigen::Isometry3d& T_map_lidar) {
  static_map_.insert(labelled, T_map_lidar);
  if (!static_map_.clearing_due()) return;
  const RangeImageView view(labelled.scan, {}, config_.sensor, T_map_lidar);
  static_map_.clear_seen_through(view, labelled.scan.stamp_ns);
}

void Mapper::insert_late_labels(PointLabels labels) {
  PosedScan late = *std::exchange(pending_, std::nullopt);
  late.labelled.labels = std::move(labels);
  LabelledScan& labelled = late.labelled;
  // Whether it moved was not asked with these labels: no movable thing makes voxels.
  for (std::size_t i = 0; i < labelled.motion.size(); ++i) {
    const bool movable = is_movable(labelled.label(i));
    if (labelled.motion[i] == Motion::highly_dynamic && movable) continue;
    labelled.motion[i] = movable ? Motion::semi_static : Motion::stationary;
  }
  insert(labelled, late.T_map_lidar);
  if (labelled.labels.empty()) return;
  last_labelled_ = std::move(late);
  last_labelled_image_.reset();
}

bool Mapper::accepts(const Scan& scan) {
  if (scan.empty()) {
    last_rejection_ = {"empty", "the scan has no points"};
    return false;
  }
  if (!trajectory_.empty() && scan.stamp_ns <= trajectory_.back().stamp_ns) {
    last_rejection_ = {"out_of_order", "the scan's stamp " + std::to_string(scan.stamp_ns) +
                                           " ns is not after the last one, " +
                                           std::to_string(trajectory_.back().stamp_ns) + " ns"};
    return false;
  }
  return true;
}

bool Mapper::has_enough_points(const Scan& scan) {
  const auto at_first_place = [&](const Eigen::Vector3f& p) { return p == scan.points_lidar[0]; };
  if (!scan.empty() && std::ranges::all_of(scan.points_lidar, at_first_place)) {
    last_rejection_ = {"too_few_points", std::to_string(scan.size()) +
                                             " usable points are all at one place: that is a "
                                             "broken driver, not a scan"};
    return false;
  }
  if (scan.size() >= min_usable_points) return true;
  last_rejection_ = {"too_few_points",
                     std::to_string(scan.size()) +
                         " points are left after those that are not finite, nearer than " +
                         std::to_string(config_.prepare.min_range_m) + " m, farther than " +
                         std::to_string(config_.prepare.max_range_m) +
                         " m or on the robot itself; at least " +
                         std::to_string(min_usable_points) + " are needed"};
  return false;
}

void Mapper::resume(const MapSnapshot& view, const TileEvidenceMap& tile_evidence) {
  // First what may refuse the view.
  static_map_.resume(view, tile_evidence);
  clear_scan_state();
  for (const auto& tile : view.tiles) resumed_tiles_.insert(tile->info.id);
}

void Mapper::reset(std::uint64_t map_id) {
  static_map_.reset(map_id);
  clear_scan_state();
}

void Mapper::clear_scan_state() {
  odometry_.reset();
  pending_.reset();
  last_labelled_.reset();
  last_labelled_image_.reset();
  trajectory_.clear();
  resumed_tiles_.clear();
  prior_map_added_at_map_.reset();
}

void Mapper::add_prior_map_near(const Eigen::Vector3d& position_map) {
  if (resumed_tiles_.empty()) return;
  if (prior_map_added_at_map_ &&
      (position_map - *prior_map_added_at_map_).norm() < prior_map_update_distance_m)
    return;
  prior_map_added_at_map_ = position_map;
  const auto view = static_map_.view();
  std::vector<LabelledPoint> points_map;
  for (const auto& tile : view->tiles) {
    if (!resumed_tiles_.contains(tile->info.id)) continue;
    const Eigen::AlignedBox3d bounds_map = tile->info.bounds_map.cast<double>();
    if (bounds_map.exteriorDistance(position_map) > config_.static_map.max_range_m) continue;
    for (const Voxel& voxel : tile->voxels) {
      points_map.push_back({voxel.mean_map, voxel.evidence.winner()});
    }
  }
  odometry_.add_prior_map(points_map);
}

void Mapper::end_stage(std::string_view stage) const {
  if (listeners_.stage_ended) listeners_.stage_ended(stage);
}

}  // namespace stillmap
