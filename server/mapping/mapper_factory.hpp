#pragma once

#include <Eigen/Geometry>
#include <chrono>
#include <functional>
#include <memory>

#include "config/loaders/server_config.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "server/mapping/scan_queue.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// Opens the source of labels for scans of this lidar, which sits there on the robot. Throws
/// ModelError or ConfigError.
using OpenSegmenter = std::function<std::unique_ptr<Segmenter>(
    const SensorModel& sensor, const Eigen::Isometry3d& T_base_lidar)>;

/// Makes mappers for the lidar that the configuration names, and has them go on for one that its
/// scans have told.
class MapperFactory {
 public:
  /// With `mapper`'s settings. Scans that wait in `queue` do so for the mapper, too.
  MapperFactory(const ServerConfig& config, MapperConfig mapper, OpenSegmenter open_segmenter,
                const ScanQueue& queue, Statistics& statistics);

  /// For the lidar that the configuration names. Throws std::invalid_argument for settings with
  /// faults.
  [[nodiscard]] Mapper make(std::unique_ptr<Segmenter> segmenter, MapperListeners listeners) const;
  /// Whether a lidar can be another than the configured one.
  [[nodiscard]] bool knows_other_lidars() const { return open_segmenter_ != nullptr; }
  /// Logs where another model would suit this lidar better.
  void tell_of_better_model(const SensorModel& sensor) const;
  /// The mapper goes on for this lidar, with labels that are opened for it; where that fails, with
  /// none but those that come with scans where they may (labels.source: auto), and the status tells
  /// why.
  void use_sensor(const SensorModel& sensor, const Eigen::Isometry3d& T_base_lidar,
                  Mapper& mapper) const;

 private:
  [[nodiscard]] std::unique_ptr<SegmentationPipeline> pipeline_of(
      std::unique_ptr<Segmenter> segmenter) const;

  MapperConfig mapper_;
  AutomaticSensor automatic_;
  LabelsConfig labels_;
  OpenSegmenter open_segmenter_;
  std::chrono::milliseconds budget_;
  const ScanQueue& queue_;
  Statistics& statistics_;
};

}  // namespace stillmap::server
