#pragma once

#include <Eigen/Geometry>
#include <bitset>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// A region of the static map.
struct MapQuery {
  /// Map frame [m]; faces belong to the box. Infinite faces are allowed, NaN and min > max are not.
  Eigen::AlignedBox3d box_map;
  /// Classes wanted; none set means all. Taken before voxels are merged: a pole next to a wall is
  /// still found at a coarse resolution.
  std::bitset<semantic_class_count> classes;
  /// Voxel size of the answer [m]; 0 is the map's own. Finer than the map's own is refused.
  double resolution_m = 0.0;
  /// Largest size of a page's voxels in bytes; at least one voxel's.
  std::uint32_t max_bytes = 1'000'000;
  /// Where the last page ended; empty for the first page.
  std::string continuation;
};

struct QueryVoxel {
  Eigen::Vector3f position_map;
  SemanticClass label = SemanticClass::unlabeled;
  /// Share of the evidence that speaks for the label, 0..1.
  float confidence = 0.0F;
  std::uint32_t point_count = 0;
};

enum class QueryStatus : std::uint8_t { ok = 0, invalid_request = 1, stale_continuation = 2 };

struct MapQueryResult {
  QueryStatus status = QueryStatus::ok;
  /// Why it is not ok: names the field, its value and what would do.
  std::string reason;
  /// Version of the map that every page of this query shows.
  std::uint64_t map_version = 0;
  std::uint64_t map_id = 0;
  std::vector<QueryVoxel> voxels;
  /// Voxels of the whole answer, all pages.
  std::uint64_t total_voxels = 0;
  /// Hand back for the next page; empty after the last one.
  std::string continuation;
};

/// Bytes of one QueryVoxel on the wire; what `max_bytes` counts.
inline constexpr std::size_t query_voxel_bytes = 3 * sizeof(float) + 1 + sizeof(float) + 4;

/// Answers `query` from one view. A voxel is in the box when its position is. A continuation made
/// from another map or version is stale; a damaged one, or one of another query, is invalid.
[[nodiscard]] MapQueryResult query_map(const MapView& view, const MapQuery& query);

/// The map version that a continuation wants, to find the view it was made from.
[[nodiscard]] std::optional<std::uint64_t> continuation_version(const std::string& continuation);

}  // namespace stillmap
