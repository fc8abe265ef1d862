#include "clients/commands/query/query_report.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "clients/terminal/json.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "core/map/query/region.hpp"

namespace stillmap::cli {
namespace {

std::map<SemanticClass, std::uint64_t> count_by_class(const std::vector<QueryVoxel>& voxels) {
  std::map<SemanticClass, std::uint64_t> counts;
  for (const QueryVoxel& voxel : voxels) counts[voxel.label] += 1;
  return counts;
}

/// Infinite coordinates are null.
Json corner_json(const Eigen::Vector3d& p) {
  Json json = Json::array();
  for (const double value : p) {
    json.push_back(std::isfinite(value) ? Json(value) : Json(nullptr));
  }
  return json;
}

Json tile_json(const TileChange& tile) {
  return {{"x", tile.id.x},
          {"y", tile.id.y},
          {"change", name(tile.kind)},
          {"revision", tile.revision},
          {"voxels", tile.voxel_count}};
}

std::string tile_line(const QueryAnswer& answer) {
  const auto count = [&](TileChangeKind kind) {
    return std::to_string(std::ranges::count(answer.result.tiles, kind, &TileChange::kind));
  };
  return "since version " + std::to_string(answer.query.since->version) + ": " +
         count(TileChangeKind::appeared) + " tiles appeared, " + count(TileChangeKind::changed) +
         " changed, " + count(TileChangeKind::removed) + " removed\n";
}

}  // namespace

const char* name(TileChangeKind kind) {
  switch (kind) {
    case TileChangeKind::appeared:
      return "appeared";
    case TileChangeKind::changed:
      return "changed";
    case TileChangeKind::removed:
      return "removed";
  }
  return "unknown";
}

Json to_json(const QueryAnswer& answer) {
  Json by_class = Json::object();
  for (const auto& [label, count] : count_by_class(answer.result.voxels)) {
    by_class.set(std::string(name(label)), count);
  }
  Json tiles = Json::array();
  for (const TileChange& tile : answer.result.tiles) tiles.push_back(tile_json(tile));
  const Eigen::AlignedBox3d bounds_map = RegionShape(answer.query.region).bounds_map();
  return {
      {"voxels", answer.result.voxels.size()},
      {"classes", by_class},
      {"tiles", tiles},
      {"map_id", answer.result.map_id},
      {"map_version", answer.result.map_version},
      {"box_map", {{"min", corner_json(bounds_map.min())}, {"max", corner_json(bounds_map.max())}}},
      {"ms", answer.times.quantile(0.5)},
      {"p99_ms", answer.times.quantile(0.99)},
      {"asked", answer.times.ms.size()}};
}

std::string describe(const QueryAnswer& answer) {
  Table table({"class", "voxels"});
  for (const auto& [label, count] : count_by_class(answer.result.voxels)) {
    table.add({std::string(name(label)), std::to_string(count)});
  }
  return table.text() + std::to_string(answer.result.voxels.size()) + " voxels of map " +
         std::to_string(answer.result.map_id) + " version " +
         std::to_string(answer.result.map_version) + " in " + fixed(answer.times.quantile(0.5), 1) +
         " ms" +
         (answer.times.ms.size() == 1
              ? std::string("\n")
              : " (median of " + std::to_string(answer.times.ms.size()) + "; p99 " +
                    fixed(answer.times.quantile(0.99), 1) + " ms)\n") +
         (answer.query.since ? tile_line(answer) : std::string());
}

void require_answer(const MapQueryResult& result) {
  switch (result.status) {
    case QueryStatus::ok:
      return;
    case QueryStatus::stale_continuation:
    case QueryStatus::failed:
      throw std::runtime_error(result.reason);
    default:
      throw std::invalid_argument(result.reason);
  }
}

bool is_cloud_file(const std::string& file) {
  return file.ends_with(".pcd") || file.ends_with(".ply");
}

void write_cloud(const std::string& file, const std::vector<QueryVoxel>& voxels) {
  std::vector<ColouredPoint> points;
  points.reserve(voxels.size());
  for (const QueryVoxel& voxel : voxels) {
    points.push_back({voxel.position_map, voxel.label, voxel.confidence});
  }
  file.ends_with(".pcd") ? write_pcd(file, points) : write_ply(file, points);
}

}  // namespace stillmap::cli
