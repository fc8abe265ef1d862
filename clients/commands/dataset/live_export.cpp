#include "clients/commands/dataset/live_export.hpp"

#include <algorithm>
#include <iterator>
#include <mutex>
#include <optional>
#include <utility>

namespace stillmap::cli {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds poll_period{20};
/// Wait for the poses and labels of the last scans.
constexpr std::chrono::milliseconds drain_time{1000};

wire::CloudReadOptions reading_of(const ServerConfig& config) {
  return {.fields = config.input.fields, .intensity_scale = config.mapper.sensor.intensity_scale};
}

/// The subscriptions, each with a thread of its own, and the scans received.
class LiveInput {
 public:
  LiveInput(Client& client, const std::string& topic, const ServerConfig& config)
      : poses_(client.subscribe_odometry(
            [this](const OdometryUpdate& update) { locked().second.add_pose(update.pose); })),
        labels_(client.subscribe_labelled_scans([this](const Scan& labelled) {
          locked().second.add_labels(labelled.stamp_ns, labelled.labels);
        })),
        points_(client.subscribe_points(topic, client.status().delivery, reading_of(config),
                                        [this](const Scan& scan) {
                                          const std::scoped_lock lock(mutex_);
                                          scans_.add_scan(scan);
                                          last_scan_ = Clock::now();
                                        })) {}

  [[nodiscard]] std::optional<LiveScan> take() { return locked().second.take(); }
  [[nodiscard]] std::optional<LiveScan> take_last() { return locked().second.take_last(); }
  /// Whether the last scan is older than that; false before the first one.
  [[nodiscard]] bool is_idle_for(std::chrono::milliseconds duration) {
    const std::scoped_lock lock(mutex_);
    return last_scan_ && Clock::now() - *last_scan_ > duration;
  }
  [[nodiscard]] std::size_t without_pose() { return locked().second.without_pose(); }

  void stop_listening() { points_.end(); }

 private:
  [[nodiscard]] std::pair<std::unique_lock<std::mutex>, LiveScanSynchronizer&> locked() {
    return {std::unique_lock(mutex_), scans_};
  }

  std::mutex mutex_;
  LiveScanSynchronizer scans_;
  std::optional<Clock::time_point> last_scan_;
  // Last members: their callbacks end before the members above are destroyed.
  Subscription poses_;
  Subscription labels_;
  Subscription points_;
};

class LiveExporter {
 public:
  LiveExporter(const ServerConfig& config, const std::filesystem::path& folder)
      : servers_points_(config), output_(folder) {}

  void write(const LiveScan& live) {
    std::vector<std::uint32_t> raw_labels;
    if (!live.classes) {
      ++labels_lost_;
    } else if (!live.classes->empty()) {
      const auto ranges = servers_points_.ranges_for(live.scan, live.classes->size());
      if (ranges) raw_labels = labels_of_all_points(live.scan, *live.classes, *ranges);
      labels_misfit_ += ranges ? 0U : 1U;
    }
    output_.add(live.scan, std::move(raw_labels), live.T_map_lidar);
  }

  [[nodiscard]] std::size_t scans() const { return output_.scans(); }

  [[nodiscard]] ExportSummary finish(std::size_t without_pose) const {
    ExportSummary summary = output_.finish();
    const auto remark = [&](std::size_t scans, const char* text) {
      if (scans > 0) summary.remarks.push_back({scans, text});
    };
    remark(without_pose,
           "scans skipped, as the server did not map them; a server with delivery 'every' maps "
           "all");
    remark(labels_lost_, "scans without the server's labels, which were lost on their way");
    remark(labels_misfit_,
           "scans whose labels do not fit: give the server's own file with --config");
    return summary;
  }

 private:
  ServersPoints servers_points_;
  SequenceOutput output_;
  std::size_t labels_lost_ = 0;
  std::size_t labels_misfit_ = 0;
};

}  // namespace

ServersPoints::ServersPoints(const ServerConfig& config)
    : config_(config), known_{config.mapper.prepare} {}

std::optional<PrepareConfig> ServersPoints::ranges_for(const Scan& scan, std::size_t labels) {
  const auto fits = [&](const PrepareConfig& ranges) {
    return usable_points(scan, ranges).size() == labels;
  };
  if (std::ranges::none_of(known_, fits) && config_.automatic_sensor.is_on &&
      recognition_.learn(scan)) {
    MapperConfig mapper = config_.mapper;
    use_sensor(*recognition_.sensor(), config_.automatic_sensor, mapper);
    known_.push_back(mapper.prepare);
  }
  const auto fitting = std::ranges::find_if(known_, fits);
  if (fitting == known_.end()) return std::nullopt;
  std::rotate(known_.begin(), fitting, std::next(fitting));
  return known_.front();
}

void LiveScanSynchronizer::add_scan(const Scan& scan) {
  waiting_.push_back(scan);
  if (waiting_.size() <= max_waiting) return;
  waiting_.pop_front();
  ++without_pose_;
}

void LiveScanSynchronizer::add_pose(const StampedPose& pose) {
  T_map_lidar_.insert_or_assign(pose.stamp_ns, pose.T_map_lidar);
  if (T_map_lidar_.size() > 2 * max_waiting) T_map_lidar_.erase(T_map_lidar_.begin());
}

void LiveScanSynchronizer::add_labels(std::int64_t stamp_ns, std::vector<SemanticClass> classes) {
  classes_.insert_or_assign(stamp_ns, std::move(classes));
  if (classes_.size() > max_waiting) classes_.erase(classes_.begin());
}

std::optional<LiveScan> LiveScanSynchronizer::take() { return take_if(false); }

std::optional<LiveScan> LiveScanSynchronizer::take_last() { return take_if(true); }

std::optional<LiveScan> LiveScanSynchronizer::take_if(bool all_arrived) {
  while (!waiting_.empty()) {
    const std::int64_t stamp_ns = waiting_.front().stamp_ns;
    const auto pose = T_map_lidar_.find(stamp_ns);
    const auto later = T_map_lidar_.upper_bound(stamp_ns);
    if (pose == T_map_lidar_.end()) {
      if (later == T_map_lidar_.end() && !all_arrived) return std::nullopt;
      waiting_.pop_front();
      ++without_pose_;
      continue;
    }
    const auto labels = classes_.find(stamp_ns);
    const auto later_poses = static_cast<std::size_t>(std::distance(later, T_map_lidar_.end()));
    if (labels == classes_.end() && later_poses < max_label_delay_scans && !all_arrived) {
      return std::nullopt;
    }
    LiveScan live{
        .scan = std::move(waiting_.front()), .T_map_lidar = pose->second, .classes = std::nullopt};
    if (labels != classes_.end()) live.classes = std::move(labels->second);
    waiting_.pop_front();
    return live;
  }
  return std::nullopt;
}

ExportSummary export_live(Client& client, const LiveExportOptions& options,
                          const ServerConfig& config, const std::filesystem::path& folder,
                          StopSignal& stop, const std::function<void(std::size_t)>& scan_done) {
  LiveExporter output(config, folder);
  LiveInput input(client, options.topic, config);
  bool stopped = false;
  while (!stopped && output.scans() < options.scans && !input.is_idle_for(options.idle_timeout)) {
    stopped = stop.wait_for(poll_period);
    while (const auto live = output.scans() < options.scans ? input.take() : std::nullopt) {
      output.write(*live);
      scan_done(output.scans());
    }
  }
  if (output.scans() < options.scans) {
    input.stop_listening();
    (void)stop.wait_for(drain_time);
    while (const auto live = input.take_last()) output.write(*live);
  }
  return output.finish(input.without_pose());
}

}  // namespace stillmap::cli
