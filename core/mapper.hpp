#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/prepare.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/map/static_map.hpp"
#include "core/odometry/odometry.hpp"
#include "core/odometry/odometry_state.hpp"
#include "core/odometry/trajectory.hpp"
#include "core/segmentation/label_source.hpp"

namespace stillmap {

struct MapperConfig {
  SensorModel sensor;
  PrepareConfig prepare;
  OdometryConfig odometry;
  StaticMapConfig static_map;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// What became of one scan.
struct MappedScan {
  OdometryResult odometry;
  /// The prepared scan (lidar frame) with labels and motion of every point.
  LabelledScan labelled;
};

/// Why a scan was not mapped.
struct ScanRejection {
  /// Counter's name in the status: "empty", "out_of_order", "too_few_points".
  std::string counter;
  std::string reason;
};

/// Called when a stage of the pipeline has ended, with its name: "prepare", "segment", "odometry",
/// "static_map". The caller owns the clock.
using StageListener = std::function<void(std::string_view stage)>;

/// The way of a scan through the product: prepare, segment, register, split by motion, map. One
/// thread calls it; nothing in it waits, reads a clock or owns a thread.
class Mapper {
 public:
  /// Throws std::invalid_argument with `config.faults()`.
  Mapper(const MapperConfig& config, std::unique_ptr<LabelSource> label_source,
         StageListener stage_ended = {});

  /// Maps one scan. `T_map_lidar_prior` replaces the constant-velocity prediction. A scan that
  /// cannot be mapped leaves the mapper as it was and returns nothing; `last_rejection()` says why.
  [[nodiscard]] std::optional<MappedScan> process(
      Scan raw_scan, const std::optional<Eigen::Isometry3d>& T_map_lidar_prior = std::nullopt);

  [[nodiscard]] const ScanRejection& last_rejection() const { return last_rejection_; }
  [[nodiscard]] const Trajectory& trajectory() const { return trajectory_; }
  [[nodiscard]] std::string label_source() const { return label_source_->name(); }
  [[nodiscard]] std::shared_ptr<const MapView> map_view() { return static_map_.view(); }

  /// Takes over a stored static map; the next scans extend it. The lidar starts at the map's
  /// origin.
  void restore(const MapView& view);

  /// Forgets poses and maps; the next scan starts map `map_id` at the origin.
  void reset(std::uint64_t map_id);

 private:
  /// Fewer points give no pose.
  static constexpr std::size_t min_usable_points = 100;

  [[nodiscard]] bool accepts(const Scan& scan);
  [[nodiscard]] bool has_enough_points(const Scan& scan);
  void end_stage(std::string_view stage) const;

  MapperConfig config_;
  std::unique_ptr<LabelSource> label_source_;
  StageListener stage_ended_;
  Odometry odometry_;
  StaticMap static_map_;
  Trajectory trajectory_;
  ScanRejection last_rejection_;
};

}  // namespace stillmap
