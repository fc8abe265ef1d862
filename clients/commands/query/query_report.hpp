#pragma once

#include <string>
#include <vector>

#include "clients/commands/stage_stopwatch.hpp"
#include "clients/terminal/json.hpp"
#include "core/map/query/map_query.hpp"

namespace stillmap::cli {

/// A query and its result.
struct QueryAnswer {
  MapQuery query;
  MapQueryResult result;
  /// Of every repetition, all pages together.
  StageDurations times;
};

[[nodiscard]] Json to_json(const QueryAnswer& answer);
/// The same for people, shorter.
[[nodiscard]] std::string describe(const QueryAnswer& answer);

/// Throws std::invalid_argument for what cannot be asked, and std::runtime_error for what only
/// cannot be answered now.
void require_answer(const MapQueryResult& result);

/// "appeared", "changed", "removed".
[[nodiscard]] const char* name(TileChangeKind kind);

/// Whether write_cloud takes a file of this name.
[[nodiscard]] bool is_cloud_file(const std::string& file);

/// Writes a point for every voxel, with its class and colour, to a .pcd or .ply file.
/// Throws DatasetError.
void write_cloud(const std::string& file, const std::vector<QueryVoxel>& voxels);

}  // namespace stillmap::cli
