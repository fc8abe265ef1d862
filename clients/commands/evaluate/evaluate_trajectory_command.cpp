#include <filesystem>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <system_error>

#include "clients/commands/arguments/mount_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/mapping/pose_files.hpp"
#include "clients/commands/mapping/trajectory_report.hpp"
#include "clients/terminal/json.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/frames/rigid_motion.hpp"

namespace stillmap::cli {
namespace {

struct EvaluateTrajectoryArguments {
  std::string truth, estimate;
  std::string truth_calib, estimate_calib;
  std::string frame = "lidar";
  MountArguments truth_mount;
  double max_difference_s = 0.05;
  std::string pictures;
  bool json = false;
};

PoseFile read_in_frame(const std::string& file, const std::string& calib) {
  PoseFile poses = read_pose_file(file);
  if (!calib.empty()) {
    poses.poses = lidar_poses_from_camera(poses.poses, read_kitti_calibration(calib));
  }
  return poses;
}

// Axis of the sensor, 0 = x, along which it mostly travels.
int travel_axis(const std::vector<Eigen::Isometry3d>& poses) {
  Eigen::Vector3d travelled = Eigen::Vector3d::Zero();
  for (std::size_t i = 1; i < poses.size(); ++i) {
    travelled += (poses[i - 1].inverse() * poses[i].translation()).cwiseAbs();
  }
  Eigen::Index axis = 0;
  travelled.maxCoeff(&axis);
  return static_cast<int>(axis);
}

// A mix of camera and lidar frames gives errors that look like bad odometry.
std::string frame_warning(const evaluation::PosePairs& pairs) {
  const int truth = travel_axis(pairs.truth);
  const int estimate = travel_axis(pairs.estimate);
  if (truth == estimate) return {};
  const std::string axes = "xyz";
  return std::string("the true sensor travels along its ") + axes[static_cast<std::size_t>(truth)] +
         " axis and the estimated one along " + axes[static_cast<std::size_t>(estimate)] +
         ": one file may be in the camera frame (give --truth-calib or --estimate-calib)";
}

/// Throws std::invalid_argument where there can be none.
void make_folder(const std::string& pictures) {
  std::error_code error;
  std::filesystem::create_directories(pictures, error);
  if (!error) return;
  throw std::invalid_argument("--pictures " + pictures + ": no folder can be made there (" +
                              error.message() + "); name a folder");
}

ExitCode run(const EvaluateTrajectoryArguments& arguments) {
  PoseFile truth = read_in_frame(arguments.truth, arguments.truth_calib);
  // From poses of the lidar to those of the robot, whose map is where its own first pose is.
  if (const auto T_base_lidar = arguments.truth_mount.T_base_lidar()) {
    for (Eigen::Isometry3d& T : truth.poses) T = motion_of_frame(*T_base_lidar, T);
  }
  const PoseFile estimate = read_in_frame(arguments.estimate, arguments.estimate_calib);
  const bool converted = !arguments.truth_calib.empty() || !arguments.estimate_calib.empty();
  const bool is_mounted = !arguments.truth_mount.xyz_rpy.empty();
  const std::string frame = is_mounted ? "base" : converted ? "lidar" : arguments.frame;
  const evaluation::PosePairs pairs =
      pair_poses(truth, estimate, static_cast<std::int64_t>(1e9 * arguments.max_difference_s));
  if (!arguments.pictures.empty()) make_folder(arguments.pictures);
  const TrajectoryReport report = report_trajectory(pairs);
  const std::string warning = frame_warning(pairs);
  if (!warning.empty()) std::cerr << "stillmap: warning: " << warning << "\n";
  if (!arguments.pictures.empty()) {
    draw_trajectories(arguments.pictures, pairs, report,
                      frame == "camera" ? GroundPlane::xz : GroundPlane::xy);
  }
  if (arguments.json) {
    Json json = to_json(report);
    json.set("frame", frame);
    json.set("warning", warning);
    std::cout << json.dump(2) << "\n";
  } else {
    std::cout << "Frame of both: " << frame << (converted ? " (converted from camera)" : "") << "\n"
              << describe(report);
  }
  return ExitCode::ok;
}

}  // namespace

void add_evaluate_trajectory_command(CommandHandle evaluate, Action& action) {
  auto arguments = std::make_shared<EvaluateTrajectoryArguments>();
  CommandHandle command = evaluate.command(
      "trajectory",
      "Errors of an estimated trajectory: ATE, relative error a frame, KITTI odometry metric");
  command.option("--truth", arguments->truth, "True poses, KITTI (3x4) or TUM form").required();
  command.option("--estimate", arguments->estimate, "Estimated poses, KITTI or TUM form")
      .required();
  command.option("--truth-calib", arguments->truth_calib,
                 "The truth is in the camera frame: convert with Tr of this calib.txt");
  command.option("--estimate-calib", arguments->estimate_calib, "The same for the estimate");
  add_mount_option(command, arguments->truth_mount,
                   "The truth is of the lidar, the estimate of the robot: convert the truth");
  command
      .option("--frame", arguments->frame,
              "Frame of both files when nothing is converted: lidar or camera")
      .one_of({"lidar", "camera"})
      .with_default();
  command
      .option("--max-difference", arguments->max_difference_s,
              "Poses with stamps pair when at most this far apart [s]")
      .zero_to(3600)
      .with_default();
  command.option("--pictures", arguments->pictures,
                 "Folder for trajectory.png and trajectory_error.png");
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap evaluate trajectory --truth city/poses.txt --truth-calib city/calib.txt \\\n"
      "      --estimate city_map/poses_lidar.txt --pictures city_map\n"
      "  stillmap evaluate trajectory --truth 05_truth.txt --estimate 05.txt --frame camera "
      "--json\n"
      "Files in TUM form pair by stamp, others line by line.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
