#include "core/mapper.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/lidar/rings.hpp"

namespace stillmap {

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

Mapper::Mapper(const MapperConfig& config, std::unique_ptr<LabelSource> label_source,
               StageListener stage_ended)
    : config_(checked(config)),
      label_source_(std::move(label_source)),
      stage_ended_(std::move(stage_ended)),
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

  // Class of every point.
  PointLabels labels = label_source_->label(scan);
  end_stage("segment");

  // Pose, and what moves.
  if (config_.prepare.compensate_motion)
    scan = compensate_motion(std::move(scan), odometry_.motion_during(config_.sensor.period_s),
                             config_.sensor.period_s);
  Odometry::Step step = odometry_.add(scan, labels, T_map_lidar_prior);
  end_stage("odometry");

  // The static map takes what stands still.
  MappedScan mapped{step.result, {std::move(scan), std::move(labels), std::move(step.motion)}};
  static_map_.insert(mapped.labelled, step.result.T_map_lidar);
  trajectory_.push_back({mapped.labelled.scan.stamp_ns, step.result.T_map_lidar});
  end_stage("static_map");
  return mapped;
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

void Mapper::restore(const MapView& view) { static_map_.restore(view); }

void Mapper::reset(std::uint64_t map_id) {
  odometry_.reset();
  static_map_.reset(map_id);
  trajectory_.clear();
}

void Mapper::end_stage(std::string_view stage) const {
  if (stage_ended_) stage_ended_(stage);
}

}  // namespace stillmap
