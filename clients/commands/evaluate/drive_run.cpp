#include "clients/commands/evaluate/drive_run.hpp"

#include <algorithm>
#include <ctime>
#include <sstream>
#include <utility>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "core/lidar/angle_units.hpp"

namespace stillmap::cli {
namespace {

MapperConfig weighted(MapperConfig config, const std::string& weighting) {
  config.odometry.weighting = weighting_from_name(weighting);
  return config;
}

/// Time of all threads of this process on processors [ms].
double process_ms() {
  return 1e3 * static_cast<double>(std::clock()) / static_cast<double>(CLOCKS_PER_SEC);
}

std::string in_words(const Eigen::Isometry3d& motion) {
  std::ostringstream text;
  text << 100.0 * motion.translation().norm() << " cm "
       << evaluation::rotation_angle(motion) * deg_per_rad << " deg";
  return text.str();
}

}  // namespace

const PointLabels& SharedLabels::segment(const Scan& scan) {
  if (!labels_ || labelled_points_ != scan.size()) {
    labels_ = source_->segment(scan);
    labelled_points_ = scan.size();
  }
  return *labels_;
}

std::size_t DriveResult::count(OdometryHealth of) const {
  const auto found = health.find(of);
  return found == health.end() ? 0 : found->second;
}

Json to_json(const DriveResult& result) {
  Json json = {{"weighting", result.weighting},
               {"scans", result.scans},
               {"rejected", result.rejected},
               {"good", result.count(OdometryHealth::good)},
               {"degenerate", result.count(OdometryHealth::degenerate)},
               {"lost", result.count(OdometryHealth::lost)},
               {"voxels", result.voxels},
               {"median_ms", result.duration.quantile(0.5)},
               {"p99_ms", result.duration.quantile(0.99)},
               {"max_ms", result.duration.quantile(1.0)},
               {"median_processor_ms", result.processor_time.quantile(0.5)},
               {"trajectory", nullptr},
               {"health", nullptr}};
  if (result.report) json.set("trajectory", to_json(*result.report));
  if (result.score) {
    const evaluation::HealthScore& score = *result.score;
    json.set("health", {{"poses", score.poses},
                        {"wrong", score.wrong},
                        {"wrong_called_good", score.wrong_called_good},
                        {"right_called_bad", score.right_called_bad}});
  }
  return json;
}

DriveRun::DriveRun(const std::string& weighting, MapperConfig config,
                   std::unique_ptr<Segmenter> labels)
    : weighting_(weighting),
      mapper_(
          weighted(std::move(config), weighting), std::move(labels),
          {.stage_ended = [this](std::string_view stage) { end_stage(stage); }, .pose_found = {}}) {
}

void DriveRun::end_stage(std::string_view stage) {
  const Clock::time_point now = Clock::now();
  if (stage != "segment")
    scan_ms_ += std::chrono::duration<double, std::milli>(now - stage_began_).count();
  stage_began_ = now;
  const double processor_ms = process_ms();
  if (stage != "segment") scan_processor_ms_ += processor_ms - stage_began_processor_ms_;
  stage_began_processor_ms_ = processor_ms;
}

const OdometryResult* DriveRun::map(Scan scan,
                                    const std::optional<Eigen::Isometry3d>& T_world_lidar_true) {
  const std::size_t place = scans_++;
  scan_ms_ = 0.0;
  scan_processor_ms_ = 0.0;
  stage_began_ = Clock::now();
  stage_began_processor_ms_ = process_ms();
  const std::optional<MappedScan> mapped = mapper_.process(std::move(scan));
  if (!mapped) return nullptr;
  duration_.ms.push_back(scan_ms_);
  processor_time_.ms.push_back(scan_processor_ms_);
  last_ = mapped->odometry;
  places_.push_back(place);
  poses_.push_back({T_world_lidar_true, last_.T_map_lidar, last_.health});
  return &last_;
}

std::string DriveRun::last_error() const {
  if (poses_.size() < 2) return {};
  const evaluation::EvaluatedPose& before = poses_[poses_.size() - 2];
  const evaluation::EvaluatedPose& now = poses_.back();
  if (!before.T_world_lidar_true || !now.T_world_lidar_true) return {};
  const Eigen::Isometry3d truth = before.T_world_lidar_true->inverse() * *now.T_world_lidar_true;
  const Eigen::Isometry3d step = truth.inverse() * before.T_map_lidar.inverse() * now.T_map_lidar;
  std::ostringstream text;
  text << "step " << in_words(truth) << ", error " << in_words(step);
  const evaluation::EvaluatedPose& first = poses_.front();
  if (!first.T_world_lidar_true) return text.str();
  const Eigen::Isometry3d since_first =
      first.T_world_lidar_true->inverse() * *now.T_world_lidar_true;
  text << ", pose off by "
       << in_words(since_first.inverse() * first.T_map_lidar.inverse() * now.T_map_lidar);
  return text.str();
}

DriveResult DriveRun::result() {
  DriveResult result;
  result.weighting = weighting_;
  result.scans = scans_;
  result.rejected = scans_ - poses_.size();
  evaluation::PosePairs pairs;
  for (const evaluation::EvaluatedPose& pose : poses_) {
    ++result.health[pose.health];
    if (!pose.T_world_lidar_true) continue;
    pairs.truth.push_back(*pose.T_world_lidar_true);
    pairs.estimate.push_back(pose.T_map_lidar);
  }
  result.voxels = mapper_.map_snapshot()->tiles.voxel_count();
  result.duration = duration_;
  result.processor_time = processor_time_;
  if (pairs.size() < 2) return result;
  result.report = report_trajectory(pairs);
  result.score = evaluation::health_score(poses_);
  for (auto* places : {&result.score->wrong_called_good, &result.score->right_called_bad})
    for (std::size_t& place : *places) place = places_[place];
  return result;
}

}  // namespace stillmap::cli
