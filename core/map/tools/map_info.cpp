#include "core/map/tools/map_info.hpp"

#include <SQLiteCpp/Database.h>

#include <algorithm>

#include "core/map/storage/map_file_copy.hpp"
#include "core/map/storage/session_tables.hpp"

namespace stillmap {
namespace {

void count_voxel(const Voxel& voxel, MapInfo& info) {
  const bool is_first = info.points == 0;
  info.points += voxel.point_count;
  ++info.voxels_of_class.at(static_cast<std::size_t>(voxel.evidence.winner()));
  info.bounds_map.extend(voxel.mean_map.cast<double>());
  info.observation_span.first_ns =
      is_first ? voxel.first_seen_ns
               : std::min(info.observation_span.first_ns, voxel.first_seen_ns);
  info.observation_span.last_ns =
      is_first ? voxel.last_seen_ns : std::max(info.observation_span.last_ns, voxel.last_seen_ns);
}

double step_m(const SharedTrajectory& path, std::size_t to) {
  return (path[to].T_map_lidar.translation() - path[to - 1].T_map_lidar.translation()).norm();
}

void measure_path(const SharedTrajectory& trajectory, MapInfo& info) {
  info.poses = trajectory.size();
  if (trajectory.empty()) return;
  const auto [first, last] = std::ranges::minmax(trajectory, {}, &StampedPose::stamp_ns);
  info.trajectory_span = {first.stamp_ns, last.stamp_ns};
  for (std::size_t i = 1; i < trajectory.size(); ++i) info.path_length_m += step_m(trajectory, i);
}

/// From where one session ended to where the next one began, nobody drove.
double way_between_sessions_m(SQLite::Database& database, const SharedTrajectory& path) {
  double way_m = 0.0;
  for (const MapSession& session : read_sessions(database, path))
    if (session.poses > 0 && session.first_pose > 0) way_m += step_m(path, session.first_pose);
  return way_m;
}

}  // namespace

MapInfo describe_map(const SavedMap& map) {
  MapInfo info;
  info.map_id = map.view.map_id;
  info.version = map.view.version;
  info.tile_size_m = map.view.tile_size_m;
  info.voxel_size_m = map.view.voxel_size_m;
  info.tiles = map.view.tiles.size();
  for (const auto& tile : map.view.tiles) {
    info.voxels += tile->voxels.size();
    for (const Voxel& voxel : tile->voxels) count_voxel(voxel, info);
  }
  measure_path(map.trajectory, info);
  info.metadata = map.metadata;
  return info;
}

MapFileInfo map_file_info(const std::filesystem::path& file) {
  const MapFileCopy copy(file);
  const SavedMap map = copy.load();
  MapFileInfo info{.map = describe_map(map),
                   .bytes = std::filesystem::file_size(copy.path()),
                   .schema_version = 0};
  SQLite::Database database(copy.path().string());
  info.schema_version = database.execAndGet("PRAGMA user_version").getUInt();
  info.map.path_length_m -= way_between_sessions_m(database, map.trajectory);
  return info;
}

}  // namespace stillmap
