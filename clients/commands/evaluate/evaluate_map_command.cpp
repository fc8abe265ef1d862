#include <algorithm>
#include <iostream>
#include <memory>
#include <stdexcept>

#include "clients/commands/arguments/mount_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/dataset/recording.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/dataset/scan_merge.hpp"
#include "core/evaluation/map_cleaning.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/map/storage/map_sessions.hpp"

namespace stillmap::cli {
namespace {

struct EvaluateMapArguments {
  std::string truth;
  std::string map;
  std::string poses = "map";
  MountArguments mount;
  double max_range_m = 60.0;
  double voxel_size_m = 0.2;
  bool json = false;
};

// Scans are told apart by their stamps, which those of another session may have, too.
void require_one_session(const EvaluateMapArguments& arguments) {
  const std::size_t sessions = read_map_sessions(arguments.map).size();
  if (sessions <= 1) return;
  throw std::invalid_argument(arguments.map + " is made of " + std::to_string(sessions) +
                              " sessions, whose poses cannot be told apart by stamps; "
                              "'stillmap sessions --withdraw' writes it as it was after the first");
}

// Poses of the lidar of the labelled scans in the true map. With the map's own poses the figures
// measure the cleaning alone; with true poses drift counts as well.
Trajectory poses_for_truth(const EvaluateMapArguments& arguments, const ScanDataset& dataset,
                           const SavedMap& map) {
  const Eigen::Isometry3d T_base_lidar =
      arguments.mount.T_base_lidar().value_or(Eigen::Isometry3d::Identity());
  if (arguments.poses == "map") {
    require_one_session(arguments);
    Trajectory poses = map.trajectory.to_vector();
    for (StampedPose& pose : poses) pose.T_map_lidar = pose.T_map_lidar * T_base_lidar;
    return poses;
  }
  std::optional<Trajectory> truth = dataset.truth();
  if (!truth) throw DatasetError(arguments.truth, "has no true poses; use --poses map");
  // They begin at the lidar's first pose, the map at the robot's.
  for (StampedPose& pose : *truth) pose.T_map_lidar = T_base_lidar * pose.T_map_lidar;
  return *std::move(truth);
}

void add_scan(evaluation::MapTruth& truth, const DatasetFrame& frame,
              const Eigen::Isometry3d& T_map_lidar, double max_range_m) {
  std::vector<Eigen::Vector3f> points_map;
  std::vector<std::uint16_t> ids;
  const Eigen::Isometry3f T = T_map_lidar.cast<float>();
  for (std::size_t i = 0; i < frame.scan.size(); ++i) {
    const Eigen::Vector3f& point_lidar = frame.scan.points_lidar[i];
    if (!(point_lidar.norm() <= static_cast<float>(max_range_m))) continue;
    points_map.push_back(T * point_lidar);
    ids.push_back(static_cast<std::uint16_t>(frame.raw_labels[i]));
  }
  truth.add(points_map, ids);
}

evaluation::MapTruth true_map(const EvaluateMapArguments& arguments, const ScanDataset& dataset,
                              const Trajectory& trajectory) {
  evaluation::MapTruth truth(arguments.voxel_size_m);
  Progress progress("true map", "scans", dataset.size());
  std::size_t used = 0;
  for (std::size_t i = 0; i < dataset.size(); ++i) {
    const auto pose = std::lower_bound(
        trajectory.begin(), trajectory.end(), dataset.stamp_ns(i),
        [](const StampedPose& p, std::int64_t stamp_ns) { return p.stamp_ns < stamp_ns; });
    progress.update(i + 1);
    if (pose == trajectory.end() || pose->stamp_ns != dataset.stamp_ns(i)) continue;
    if (!dataset.has_labels(i)) continue;
    DatasetFrame frame = dataset.read(i);
    frame.scan = at_one_instant(std::move(frame.scan), trajectory,
                                static_cast<std::size_t>(pose - trajectory.begin()));
    add_scan(truth, frame, pose->T_map_lidar, arguments.max_range_m);
    ++used;
  }
  if (used == 0) {
    throw std::invalid_argument("no labelled scan of " + arguments.truth +
                                " has the stamp of a pose: is this the sequence that " +
                                arguments.map + " was made from?");
  }
  return truth;
}

std::vector<Eigen::Vector3f> points_of(const MapSnapshot& view) {
  std::vector<Eigen::Vector3f> points;
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) points.push_back(voxel.mean_map);
  }
  return points;
}

Json to_json(const evaluation::MapCleaningScore& score, const EvaluateMapArguments& arguments) {
  const auto number = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json(nullptr);
  };
  Json thin = Json::object();
  for (std::size_t i = 0; i < evaluation::thin_classes.size(); ++i) {
    thin.set(name(evaluation::thin_classes.at(i)),
             {{"voxels", score.thin_voxels.at(i)},
              {"voxels_kept", score.thin_kept.at(i)},
              {"preservation_rate", number(score.thin_preservation_rate(i))}});
  }
  return {{"preservation_rate", number(score.preservation_rate())},
          {"preservation_rate_with_parked", number(score.preservation_rate_with_parked())},
          {"rejection_rate", number(score.rejection_rate())},
          {"parked_rejection_rate", number(score.parked_rejection_rate())},
          {"f1", number(score.f1())},
          {"fixed_voxels", score.fixed_voxels},
          {"parked_voxels", score.parked_voxels},
          {"moving_voxels", score.moving_voxels},
          {"moving_voxels_kept", score.moving_kept},
          {"thin", thin},
          {"voxel_size_m", arguments.voxel_size_m},
          {"poses", arguments.poses}};
}

std::string describe(const evaluation::MapCleaningScore& score) {
  const auto percent = [](const std::optional<double>& share) {
    return share ? fixed(100.0 * *share, 2) : std::string("-");
  };
  Table table({"against the labelled truth", "voxels", "in the map", "%"});
  table.add({"fixed: preservation rate", std::to_string(score.fixed_voxels),
             std::to_string(score.fixed_kept), percent(score.preservation_rate())});
  for (std::size_t i = 0; i < evaluation::thin_classes.size(); ++i) {
    if (score.thin_voxels.at(i) == 0) continue;
    table.add({"  of these " + std::string(name(evaluation::thin_classes.at(i))),
               std::to_string(score.thin_voxels.at(i)), std::to_string(score.thin_kept.at(i)),
               percent(score.thin_preservation_rate(i))});
  }
  table.add({"parked, left out by design", std::to_string(score.parked_voxels),
             std::to_string(score.parked_kept), ""});
  table.add({"fixed and parked (as ERASOR counts)",
             std::to_string(score.fixed_voxels + score.parked_voxels),
             std::to_string(score.fixed_kept + score.parked_kept),
             percent(score.preservation_rate_with_parked())});
  table.add({"moving", std::to_string(score.moving_voxels), std::to_string(score.moving_kept), ""});
  return table.text() + "rejection rate: moving " + percent(score.rejection_rate()) +
         " %, parked " + percent(score.parked_rejection_rate()) +
         " %; F1 of preservation and rejection of what moves: " + percent(score.f1()) + " %\n";
}

ExitCode run(const EvaluateMapArguments& arguments) {
  end_cleanly_when_stopped();
  const SavedMap map = read_map_file(arguments.map);
  ScanDataset dataset(arguments.truth);
  dataset.join_turns();
  require_semantic_kitti_labels(dataset);
  const evaluation::MapTruth truth =
      true_map(arguments, dataset, poses_for_truth(arguments, dataset, map));
  const evaluation::MapCleaningScore score =
      evaluation::map_cleaning_score(truth, points_of(map.view));
  std::cout << (arguments.json ? to_json(score, arguments).dump(2) + "\n" : describe(score));
  return ExitCode::ok;
}

}  // namespace

void add_evaluate_map_command(CommandHandle evaluate, Action& action) {
  auto arguments = std::make_shared<EvaluateMapArguments>();
  CommandHandle command = evaluate.command(
      "map", "Preservation and rejection rate of a static map against labelled scans");
  command.option("--truth", arguments->truth, "The labelled sequence").required();
  command.option("--map", arguments->map, "Map file made from it (map.stillmap)").required();
  command
      .option("--poses", arguments->poses,
              "Put the true scans at the map's own poses, or at the true ones so that "
              "drift counts as well: map, truth")
      .one_of({"map", "truth"})
      .with_default();
  add_mount_option(command, arguments->mount, "As given to 'stillmap map'");
  command
      .option("--max-range", arguments->max_range_m,
              "True points farther from the lidar are left out [m]; as in the mapper")
      .above_zero()
      .with_default();
  command.option("--voxel-size", arguments->voxel_size_m, "Of the true map [m]")
      .above_zero()
      .with_default();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Example:\n"
      "  stillmap evaluate map --truth city --map city_map/map.stillmap\n"
      "As in ERASOR (RA-L 2021): a true voxel counts as kept when a map point lies within half\n"
      "its diagonal. Parked vehicles are counted apart: the planning map leaves them out. Of what\n"
      "is fixed, things thinner than a voxel are told apart as well (thin of --json): rays pass\n"
      "beside them, and cleaning takes them first.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
