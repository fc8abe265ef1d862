#include "clients/commands/mapping/trajectory_report.hpp"

#include <algorithm>
#include <array>

#include "clients/terminal/json.hpp"
#include "clients/terminal/table.hpp"
#include "core/lidar/angle_units.hpp"

namespace stillmap::cli {
namespace {

void add_absolute(Table& table, const std::string& alignment,
                  const evaluation::AbsoluteTrajectoryError& error) {
  table.add({"ATE, aligned: " + alignment, fixed(error.rmse_m, 3) + " m",
             fixed(error.mean_m, 3) + " m", fixed(error.max_m, 3) + " m"});
}

}  // namespace

TrajectoryReport report_trajectory(const evaluation::PosePairs& pairs) {
  return {
      .poses = pairs.size(),
      .path_m = evaluation::distance_travelled(pairs.truth).back(),
      .unaligned = evaluation::absolute_trajectory_error(pairs, evaluation::Alignment::none),
      .first_aligned =
          evaluation::absolute_trajectory_error(pairs, evaluation::Alignment::first_pose),
      .rigid_aligned = evaluation::absolute_trajectory_error(pairs, evaluation::Alignment::rigid),
      .relative = evaluation::relative_pose_error(pairs),
      .kitti = evaluation::kitti_odometry_error(pairs)};
}

std::string describe(const TrajectoryReport& report) {
  Table table({std::to_string(report.poses) + " poses, " + fixed(report.path_m, 1) + " m", "RMSE",
               "mean", "max"});
  add_absolute(table, "not", report.unaligned);
  add_absolute(table, "first pose", report.first_aligned);
  add_absolute(table, "best rigid fit", report.rigid_aligned);
  if (report.relative) {
    const evaluation::RelativePoseError& step = *report.relative;
    table.add({"motion from pose to pose", fixed(100.0 * step.rmse_translation_m, 2) + " cm",
               fixed(100.0 * step.mean_translation_m, 2) + " cm",
               fixed(100.0 * step.max_translation_m, 2) + " cm"});
    table.add({"turn from pose to pose", "",
               fixed(deg_per_rad * step.mean_rotation_rad, 4) + " deg",
               fixed(deg_per_rad * step.max_rotation_rad, 4) + " deg"});
  }
  std::string text = table.text();
  if (!report.kitti) return text + "KITTI odometry: the path is shorter than 100 m\n";
  text += "KITTI odometry: " + fixed(report.kitti->translation_percent, 3) + " % and " +
          fixed(report.kitti->rotation_deg_per_100m, 3) + " deg/100 m over " +
          std::to_string(report.kitti->segments) + " segments of 100..800 m\n";
  return text;
}

Json to_json(const TrajectoryReport& report) {
  Json json = {{"poses", report.poses},
               {"path_m", report.path_m},
               {"ate_rmse_m", report.rigid_aligned.rmse_m},
               {"ate_max_m", report.rigid_aligned.max_m},
               {"ate_first_pose_rmse_m", report.first_aligned.rmse_m},
               {"ate_unaligned_rmse_m", report.unaligned.rmse_m},
               {"final_drift_m", report.first_aligned.final_m},
               {"relative", nullptr},
               {"kitti", nullptr}};
  if (report.relative) {
    json.set("relative", {{"mean_translation_m", report.relative->mean_translation_m},
                          {"rmse_translation_m", report.relative->rmse_translation_m},
                          {"max_translation_m", report.relative->max_translation_m},
                          {"mean_rotation_deg", deg_per_rad * report.relative->mean_rotation_rad},
                          {"max_rotation_deg", deg_per_rad * report.relative->max_rotation_rad}});
  }
  if (report.kitti) {
    Json by_length = Json::array();
    for (const evaluation::KittiLengthError& length : report.kitti->by_length) {
      by_length.push_back({{"length_m", length.length_m},
                           {"segments", length.segments},
                           {"translation_percent", length.translation_percent},
                           {"rotation_deg_per_100m", length.rotation_deg_per_100m}});
    }
    json.set("kitti", {{"translation_percent", report.kitti->translation_percent},
                       {"rotation_deg_per_100m", report.kitti->rotation_deg_per_100m},
                       {"segments", report.kitti->segments},
                       {"by_length", by_length}});
  }
  return json;
}

std::vector<std::filesystem::path> draw_trajectories(const std::filesystem::path& folder,
                                                     const evaluation::PosePairs& pairs,
                                                     const TrajectoryReport& report,
                                                     GroundPlane plane) {
  std::vector<Eigen::Vector3d> truth, estimate;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    truth.push_back(pairs.truth[i].translation());
    estimate.push_back(report.rigid_aligned.T_truth_estimate * pairs.estimate[i].translation());
  }
  const std::filesystem::path paths = folder / "trajectory.png";
  const std::filesystem::path errors = folder / "trajectory_error.png";
  write_path_picture(paths, truth, estimate, plane);
  const std::array<ChartLine, 2> lines{
      ChartLine{"error in m, best rigid fit", report.rigid_aligned.per_pose_m},
      ChartLine{"error in m, first poses aligned", report.first_aligned.per_pose_m}};
  write_chart(errors, "distance in m", evaluation::distance_travelled(pairs.truth), lines);
  return {paths, errors};
}

}  // namespace stillmap::cli
