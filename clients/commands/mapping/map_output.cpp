#include "clients/commands/mapping/map_output.hpp"

#include <fstream>
#include <stdexcept>

#include "clients/commands/mapping/pose_files.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/map/tools/map_export.hpp"
#include "core/picture/map_picture.hpp"

namespace stillmap::cli {
namespace {

// The truth of the scans that were mapped, in the frame of the first of them.
std::optional<Trajectory> truth_of(const ScanDataset& dataset, const MappingResult& result) {
  std::optional<Trajectory> all = dataset.truth();
  if (!all || result.trajectory.empty()) return std::nullopt;
  const Eigen::Isometry3d T_first_world =
      all->at(result.scan_of_pose.front()).T_map_lidar.inverse();
  Trajectory truth;
  for (std::size_t i = 0; i < result.scan_of_pose.size(); ++i) {
    truth.push_back({result.trajectory[i].stamp_ns,
                     T_first_world * all->at(result.scan_of_pose[i]).T_map_lidar});
  }
  return truth;
}

evaluation::PosePairs pairs_of(const Trajectory& truth, const Trajectory& estimate) {
  evaluation::PosePairs pairs;
  for (const StampedPose& pose : truth) pairs.truth.push_back(pose.T_map_lidar);
  for (const StampedPose& pose : estimate) pairs.estimate.push_back(pose.T_map_lidar);
  return evaluation::pair_by_index(pairs.truth, pairs.estimate);
}

void save_map(const std::filesystem::path& file, const MappingResult& result,
              const MapperConfig& config) {
  open_map_file(file)->save({.view = *result.view,
                             .tile_evidence = result.tile_evidence,
                             .trajectory = result.trajectory,
                             .metadata = {{"sensor", config.sensor.name},
                                          {"label_source", result.label_source},
                                          {"software", "stillmap " STILLMAP_VERSION},
                                          {map_ended_key, "yes"}}});
}

}  // namespace

std::filesystem::path map_file_in(const std::filesystem::path& folder) {
  return folder / "map.stillmap";
}

void prepare_output_folder(const std::filesystem::path& folder, bool force) {
  const std::filesystem::path file = map_file_in(folder);
  if (std::filesystem::exists(file)) {
    if (!force) {
      throw std::invalid_argument(
          file.string() + " exists already: choose another --out, or --force to replace it");
    }
    for (const char* part : {"", "-wal", "-shm"}) {
      std::filesystem::remove(file.string() + part);
    }
  }
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw DatasetError(folder, "cannot be made: " + error.message());
}

MapOutput write_map_output(const std::filesystem::path& folder, const ScanDataset& dataset,
                           const MappingResult& result, const MapperConfig& config) {
  MapOutput output{.folder = folder, .accuracy = std::nullopt};
  write_kitti_poses(folder / "poses_lidar.txt", result.trajectory);
  write_tum(folder / "poses_tum.txt", result.trajectory);
  save_map(map_file_in(folder), result, config);
  export_ply(*result.view, folder / "map.ply");
  export_pcd(*result.view, folder / "map.pcd");
  MapPictureOptions picture;
  picture.truth = truth_of(dataset, result);
  if (picture.truth) {
    const evaluation::PosePairs pairs = pairs_of(*picture.truth, result.trajectory);
    output.accuracy = report_trajectory(pairs);
    draw_trajectories(folder, pairs, *output.accuracy, GroundPlane::xy);
  }
  write_map_picture(folder / "map.png", *result.view, result.trajectory, picture);
  return output;
}

}  // namespace stillmap::cli
