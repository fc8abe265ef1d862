#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "clients/commands/stage_stopwatch.hpp"
#include "core/map/query/map_query.hpp"

namespace stillmap::cli {

/// What became of a query of the command line.
struct QueryAnswer {
  MapQuery query;
  MapQueryResult result;
  /// Of every time it was asked, all pages together.
  StageDurations times;
};

[[nodiscard]] nlohmann::json to_json(const QueryAnswer& answer);
/// The same for people, shorter.
[[nodiscard]] std::string describe(const QueryAnswer& answer);

/// "appeared", "changed", "removed".
[[nodiscard]] const char* name(TileChangeKind kind);

/// Whether write_cloud takes a file of this name.
[[nodiscard]] bool is_cloud_file(const std::string& file);

/// Writes a point for every voxel, with its class and colour, as the name ends: .pcd or .ply.
/// Throws DatasetError.
void write_cloud(const std::string& file, const std::vector<QueryVoxel>& voxels);

}  // namespace stillmap::cli
