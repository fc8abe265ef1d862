#include "clients/commands/mapping/mapping_run.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "clients/commands/mapping/imu_feed.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/map/storage/map_file.hpp"

namespace stillmap::cli {
namespace {

/// The true ids of the points that the mapper will keep.
std::vector<std::uint16_t> true_ids_of_kept_points(const DatasetFrame& frame,
                                                   const PrepareConfig& prepare) {
  if (frame.raw_labels.empty()) return {};
  std::vector<std::uint16_t> ids;
  for (const std::uint32_t i : usable_points(frame.scan, prepare)) {
    ids.push_back(static_cast<std::uint16_t>(frame.raw_labels[i]));
  }
  return ids;
}

/// One run over a data set: keeps what is reported at its end.
class MappingRun {
 public:
  MappingRun(const ScanDataset& dataset, bool strict, const MapperConfig& config,
             const MappedBody& body, std::unique_ptr<Segmenter> labels,
             const ScanSkipped& scan_skipped)
      : dataset_(dataset),
        strict_(strict),
        scan_skipped_(scan_skipped),
        T_body_lidar_(body.T_body_lidar),
        prepare_(config.prepare),
        mapper_(config, std::move(labels),
                {.stage_ended = [this](std::string_view stage) { times_.end_stage(stage); },
                 .pose_found = {}}),
        imu_(dataset.imu()),
        period_s_(config.sensor.period_s) {}

  void map_scan(std::size_t index) {
    std::optional<DatasetFrame> frame = read(index);
    if (!frame) return;
    const std::vector<std::uint16_t> true_ids = true_ids_of_kept_points(*frame, prepare_);
    for (const ImuSample& sample : imu_.take_up_to_end_of(frame->scan, period_s_))
      mapper_.add(sample);
    times_.begin();
    std::optional<Eigen::Isometry3d> T_map_lidar_first;
    const bool is_mounted = !T_body_lidar_.isApprox(Eigen::Isometry3d::Identity());
    if (is_mounted && mapper_.trajectory().empty()) T_map_lidar_first = T_body_lidar_;
    const std::optional<MappedScan> mapped =
        mapper_.process(std::move(frame->scan), T_map_lidar_first);
    if (!mapped) {
      skip({index, mapper_.last_rejection().counter,
            dataset_.file(index).string() + ": " + mapper_.last_rejection().reason});
      return;
    }
    times_.end();
    result_.scan_of_pose.push_back(index);
    result_.health[mapped->odometry.health] += 1;
    if (!true_ids.empty())
      result_.moving += evaluation::moving_score(mapped->labelled.motion, true_ids);
  }

  MappingResult finish(bool stopped) {
    const Eigen::Isometry3d T_lidar_body = T_body_lidar_.inverse();
    for (const StampedPose& pose : mapper_.trajectory()) {
      result_.trajectory.push_back({pose.stamp_ns, pose.T_map_lidar * T_lidar_body});
    }
    SavedMap map = to_saved_map(mapper_.static_map().checkpoint(CheckpointScope::everything));
    result_.view = std::make_shared<const MapSnapshot>(std::move(map.view));
    result_.tile_evidence = std::move(map.tile_evidence);
    result_.label_source = mapper_.label_source();
    result_.imu = mapper_.inertial().counts();
    result_.stages = times_.stages();
    result_.stopped = stopped;
    return std::move(result_);
  }

 private:
  std::optional<DatasetFrame> read(std::size_t index) {
    try {
      return dataset_.read(index);
    } catch (const DatasetError& error) {
      if (strict_) throw;
      skip({index, "unreadable", error.what()});
      return std::nullopt;
    }
  }

  void skip(SkippedScan scan) {
    if (scan_skipped_) scan_skipped_(scan);
    result_.skipped.push_back(std::move(scan));
  }

  const ScanDataset& dataset_;
  bool strict_;
  const ScanSkipped& scan_skipped_;
  Eigen::Isometry3d T_body_lidar_;
  PrepareConfig prepare_;
  StageStopwatch times_;
  Mapper mapper_;
  ImuFeed imu_;
  double period_s_;
  MappingResult result_;
};

}  // namespace

std::size_t ScanRange::end(const ScanDataset& dataset) const {
  if (first >= dataset.size() || count == 0) {
    throw std::invalid_argument("no scan to take: the data set has " +
                                std::to_string(dataset.size()) + ", asked for are " +
                                std::to_string(count) + " from number " + std::to_string(first));
  }
  return first + std::min(count, dataset.size() - first);
}

MappingResult map_dataset(const ScanDataset& dataset, const ScanRange& range,
                          const MapperConfig& config, const MappedBody& body,
                          std::unique_ptr<Segmenter> labels, const ScanDone& scan_done,
                          const ScanSkipped& scan_skipped) {
  const std::size_t end = range.end(dataset);
  MappingRun run(dataset, range.strict, config, body, std::move(labels), scan_skipped);
  const auto began = std::chrono::steady_clock::now();
  bool keep_running = true;
  for (std::size_t index = range.first; index < end && keep_running; ++index) {
    run.map_scan(index);
    keep_running = !scan_done || scan_done(index + 1 - range.first);
  }
  MappingResult result = run.finish(!keep_running);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return result;
}

}  // namespace stillmap::cli
