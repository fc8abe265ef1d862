#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/commands/mapping/trajectory_report.hpp"
#include "clients/commands/stage_stopwatch.hpp"
#include "clients/terminal/json.hpp"
#include "core/evaluation/pose_health.hpp"
#include "core/mapper.hpp"

namespace stillmap::cli {

/// Runs a segmenter once for all mappers that are given the same scan one after the other.
class SharedLabels {
 public:
  explicit SharedLabels(std::unique_ptr<Segmenter> source) : source_(std::move(source)) {}

  /// The scans that follow are new ones.
  void next_scan() { labels_.reset(); }
  [[nodiscard]] const PointLabels& segment(const Scan& scan);
  [[nodiscard]] std::string name() const { return source_->name(); }

 private:
  std::unique_ptr<Segmenter> source_;
  std::optional<PointLabels> labels_;
  std::size_t labelled_points_ = 0;
};

/// A mapper's end of SharedLabels.
class SharedSegmenter final : public Segmenter {
 public:
  explicit SharedSegmenter(std::shared_ptr<SharedLabels> labels) : labels_(std::move(labels)) {}

  [[nodiscard]] std::string name() const override { return labels_->name(); }
  [[nodiscard]] PointLabels segment(const Scan& scan) override { return labels_->segment(scan); }

 private:
  std::shared_ptr<SharedLabels> labels_;
};

/// What became of a drive.
struct DriveResult {
  std::string weighting;
  std::size_t scans = 0;
  std::size_t rejected = 0;
  std::map<OdometryHealth, std::size_t> health;
  /// Empty where there is no truth.
  std::optional<TrajectoryReport> report;
  /// Its places are those in the drive, from 0.
  std::optional<evaluation::HealthScore> score;
  /// Of the map: the sharper it is, the fewer.
  std::size_t voxels = 0;
  /// Of each scan, without the time for labels.
  StageDurations duration;
  /// The same in time of all processors together, which other programs hardly change.
  StageDurations processor_time;

  [[nodiscard]] std::size_t count(OdometryHealth of) const;
};

[[nodiscard]] Json to_json(const DriveResult& result);

/// One of the mappers that a drive is given to.
class DriveRun {
 public:
  /// Throws std::invalid_argument for a weighting that there is not, or a configuration with
  /// faults.
  DriveRun(const std::string& weighting, MapperConfig config, std::unique_ptr<Segmenter> labels);

  /// A sample of the IMU, before the scans whose sweeps end after it.
  void add(const ImuSample& sample) { mapper_.add(sample); }
  [[nodiscard]] const InertialTracker& inertial() const { return mapper_.inertial(); }

  /// Maps the next scan; nothing where it is rejected. `T_world_lidar_true` is its truth, nothing
  /// where it has none.
  const OdometryResult* map(Scan scan, const std::optional<Eigen::Isometry3d>& T_world_lidar_true);

  [[nodiscard]] DriveResult result();
  [[nodiscard]] const std::string& weighting() const { return weighting_; }
  /// Error of the last motion, from scan to scan, and of the last pose with the first ones aligned,
  /// in words; empty without a truth.
  [[nodiscard]] std::string last_error() const;

 private:
  using Clock = std::chrono::steady_clock;
  void end_stage(std::string_view stage);

  std::string weighting_;
  Mapper mapper_;
  /// Of the scans that were mapped, and their places in the drive.
  std::vector<evaluation::EvaluatedPose> poses_;
  std::vector<std::size_t> places_;
  OdometryResult last_;
  std::size_t scans_ = 0;
  Clock::time_point stage_began_;
  double stage_began_processor_ms_ = 0.0;
  double scan_ms_ = 0.0;
  double scan_processor_ms_ = 0.0;
  StageDurations duration_{.stage = "scan", .ms = {}};
  StageDurations processor_time_{.stage = "scan", .ms = {}};
};

}  // namespace stillmap::cli
