#include <deque>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <mutex>
#include <optional>
#include <system_error>
#include <utility>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/mapping/pose_files.hpp"
#include "clients/commands/pose_report.hpp"
#include "clients/commands/server_control/status_report.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/dataset_error.hpp"

namespace stillmap::cli {
namespace {

struct WatchArguments {
  ClientArguments client;
  /// 0: no limit.
  std::size_t count = 0;
  double duration_s = 0.0;
  std::string out;
  bool json = false;
};

/// Hands updates from the subscriptions' threads to the printing one.
class UpdateQueue {
 public:
  void add(const OdometryUpdate& pose) {
    const std::lock_guard lock(mutex_);
    poses_.push_back(pose);
  }
  void add(const dds::ServerStatus& status) {
    const std::lock_guard lock(mutex_);
    status_ = status;
  }
  std::deque<OdometryUpdate> take_poses() {
    const std::lock_guard lock(mutex_);
    return std::exchange(poses_, {});
  }
  std::optional<dds::ServerStatus> take_status() {
    const std::lock_guard lock(mutex_);
    return std::exchange(status_, std::nullopt);
  }

 private:
  std::mutex mutex_;
  std::deque<OdometryUpdate> poses_;
  std::optional<dds::ServerStatus> status_;
};

Json update_json(const OdometryUpdate& update) {
  const StampedPose& pose = update.pose;
  const Eigen::Vector3d t = pose.T_map_lidar.translation();
  const Eigen::Quaterniond q(pose.T_map_lidar.linear());
  return {{"type", "pose"},
          {"stamp_ns", pose.stamp_ns},
          {"frame", update.child_frame + " in " + update.frame},
          {"position_m", {t.x(), t.y(), t.z()}},
          {"quaternion_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
}

// One line per status, which comes each second: the newest pose, health and rates.
std::string status_line(const dds::ServerStatus& status, const std::optional<StampedPose>& newest) {
  std::string line;
  if (!newest) {
    line = status.counter("scans_mapped") > 0 ? "no new pose" : "no pose yet";
  } else {
    const Eigen::Isometry3d& T = newest->T_map_lidar;
    line = "x " + fixed(T.translation().x(), 2) + "  y " + fixed(T.translation().y(), 2) + "  z " +
           fixed(T.translation().z(), 2) + " m  yaw " + fixed(heading_deg(T), 1) + " deg";
  }
  line += "  " + std::string(name(status.health)) + "  in " + fixed(status.received_hz, 1) +
          "/s  mapped " + fixed(status.mapped_hz, 1) + "/s  dropped " +
          std::to_string(status.dropped()) + "  voxels " + std::to_string(status.voxel_count);
  return line + (status.reason.empty() ? "" : "  (" + status.reason + ")");
}

/// Prints updates until the limits are reached; keeps the poses where they are to be written.
class Watch {
 public:
  explicit Watch(const WatchArguments& arguments) : arguments_(arguments) {}

  void print(UpdateQueue& updates) {
    for (const OdometryUpdate& update : updates.take_poses()) {
      if (enough_poses()) break;
      ++poses_seen_;
      newest_ = update.pose;
      if (!arguments_.out.empty()) poses_.push_back(update.pose);
      frame_ = update.child_frame;
      if (arguments_.json) std::cout << update_json(update).dump() << "\n";
    }
    if (const std::optional<dds::ServerStatus> status = updates.take_status()) {
      if (arguments_.json) {
        Json json = status_json(*status);
        json.set("type", "status");
        std::cout << json.dump() << "\n";
      } else {
        std::cout << status_line(*status, newest_) << "\n";
      }
    }
    std::cout.flush();
  }

  [[nodiscard]] bool enough_poses() const {
    return arguments_.count > 0 && poses_seen_ >= arguments_.count;
  }
  [[nodiscard]] const Trajectory& poses() const { return poses_; }
  /// What they are poses of.
  [[nodiscard]] const std::string& frame() const { return frame_; }

 private:
  const WatchArguments& arguments_;
  std::size_t poses_seen_ = 0;
  std::optional<StampedPose> newest_;
  Trajectory poses_;
  std::string frame_;
};

/// Throws DatasetWriteError for a file that will not take the poses when they are there; what is in
/// it stays.
void check_writable(const std::filesystem::path& file) {
  std::error_code unknown;
  // Its reader would take this for the end.
  if (std::filesystem::is_fifo(file, unknown)) return;
  const bool is_new = !std::filesystem::exists(std::filesystem::symlink_status(file, unknown));
  if (!std::ofstream(file, std::ios::app))
    throw DatasetWriteError(file, "cannot be written; check the folder and its permissions");
  if (is_new) std::filesystem::remove(file, unknown);
}

ExitCode run(const WatchArguments& arguments) {
  if (!arguments.out.empty()) check_writable(arguments.out);
  StopSignal stop;
  Client client = connect(arguments.client);
  UpdateQueue updates;
  const Subscription odometry =
      client.subscribe_odometry([&](const OdometryUpdate& update) { updates.add(update); });
  const Subscription status =
      client.subscribe_status([&](const dds::ServerStatus& update) { updates.add(update); });
  Watch watch(arguments);
  const auto began = std::chrono::steady_clock::now();
  bool time_is_up = false;
  while (!stop.wait_for(std::chrono::milliseconds(50)) && !watch.enough_poses() && !time_is_up) {
    watch.print(updates);
    const std::chrono::duration<double> watched = std::chrono::steady_clock::now() - began;
    time_is_up = arguments.duration_s > 0.0 && watched.count() >= arguments.duration_s;
  }
  watch.print(updates);
  if (!arguments.out.empty()) {
    write_poses_as_named(arguments.out, watch.poses(), watch.frame());
    std::cerr << watch.poses().size() << " poses of the frame '" << watch.frame()
              << "' in the server's map written to " << arguments.out << "\n";
  }
  const bool too_few = arguments.count > 0 && !watch.enough_poses() && time_is_up;
  return too_few ? ExitCode::no_server : ExitCode::ok;
}

}  // namespace

void add_watch_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<WatchArguments>();
  CommandHandle command =
      program.command("watch", "Poses, health and rates of a server as they come");
  command.option("--count", arguments->count, "End after as many poses");
  command.option("--duration", arguments->duration_s, "End after as many seconds").above_zero();
  command.option("--out,--output,-o", arguments->out,
                 "Write the poses: KITTI 3x4, or with stamps to FILE.tum");
  command.flag("--json", arguments->json, "Print a JSON line for every pose and status");
  add_client_options(command, arguments->client);
  command.explain(
      "Examples:\n"
      "  stillmap watch\n"
      "  stillmap watch --count 100 --out poses.tum\n"
      "  stillmap watch --json | jq 'select(.type == \"pose\").position_m'\n"
      "Ends with Ctrl-C. Exit code 3 when no server answers, or when --duration ends before\n"
      "--count poses came.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
