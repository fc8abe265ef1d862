#pragma once

#include <bitset>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/map/query/region.hpp"
#include "core/map/query/tile_history.hpp"
#include "core/map/query/tile_reader.hpp"
#include "core/map/tile.hpp"

namespace stillmap {

/// A state of a map that a client has already.
struct KnownVersion {
  std::uint64_t map_id = 0;
  std::uint64_t version = 0;
};

/// A region of the static map.
struct MapQuery {
  Region region = BoxRegion{};
  /// Classes wanted; none set means all. Taken before voxels are merged: a pole next to a wall is
  /// still found at a coarse resolution.
  std::bitset<semantic_class_count> classes;
  /// Voxel size of the answer [m]; 0 is the map's own. Finer than the map's own is refused.
  double resolution_m = 0.0;
  /// Largest size of a page's voxels in bytes; at least one voxel's.
  std::uint32_t max_bytes = 4'000'000;
  /// Only tiles that changed since, at the map's own resolution.
  std::optional<KnownVersion> since;
  /// Where the last page ended; empty for the first page.
  std::string continuation;
};

struct QueryVoxel {
  Eigen::Vector3f position_map;
  SemanticClass label = SemanticClass::unlabeled;
  /// Share of the evidence for the label, 0..1.
  float confidence = 0.0F;
  std::uint32_t point_count = 0;
};

/// What became of a tile since the version that the client knows; numbers are those on the wire.
enum class TileChangeKind : std::uint8_t {
  /// Was not there at `since`; without `since`, every tile.
  appeared = 0,
  changed = 1,
  /// Has no voxels any more, in any region.
  removed = 2,
};

/// A tile of an answer. Its voxels replace all that an older answer had in the tile.
struct TileChange {
  TileId id;
  TileChangeKind kind = TileChangeKind::appeared;
  /// Version of the map in which it last changed, or was removed.
  std::uint64_t revision = 0;
  /// Voxels of the answer that are the tile's. An answer's voxels are in the order of its tiles.
  std::uint32_t voxel_count = 0;
  friend bool operator==(const TileChange&, const TileChange&) = default;
};

/// Numbers are those on the wire.
enum class QueryStatus : std::uint8_t {
  ok = 0,
  invalid_request = 1,
  stale_continuation = 2,
  /// The server could not answer.
  failed = 3,
  /// `since` is of another map, or older than the history: query again without it.
  changes_unknown = 4,
};

struct MapQueryResult {
  QueryStatus status = QueryStatus::ok;
  /// When the status is not ok: the field, its value and the allowed range.
  std::string reason;
  /// Version of the map that every page of this query shows.
  std::uint64_t map_version = 0;
  std::uint64_t map_id = 0;
  std::vector<QueryVoxel> voxels;
  /// Voxels of the whole answer, all pages; at most so many at a coarser resolution where its
  /// region has more than a million voxels.
  std::uint64_t total_voxels = 0;
  /// Tiles of the whole answer, on its first page: present tiles first, then removed ones. Empty at
  /// a coarser resolution, whose cells belong to no tile.
  std::vector<TileChange> tiles;
  /// To be passed back for the next page; empty after the last one.
  std::string continuation;
};

/// Bytes of one QueryVoxel on the wire; what `max_bytes` counts.
inline constexpr std::size_t query_voxel_bytes = 3 * sizeof(float) + 1 + sizeof(float) + 4;

/// Answers `query` from one view. A voxel is in the region when its position is. A continuation
/// made from another map or version is stale; a damaged one, or one of another query, is invalid,
/// and so are some of the voxels of each of more than 10,000 tiles. A page may end early, even
/// without a voxel, where it took much work.
/// `history` ends with this view; only the first page of a query with `since` needs it, and is
/// refused without. Non-resident tiles are read through `reader`, and some of them at once; throws
/// as it does.
[[nodiscard]] MapQueryResult query_map(const MapSnapshot& view, const MapQuery& query,
                                       const TileHistory* history, TileReader& reader);
/// For a view without non-resident tiles.
[[nodiscard]] MapQueryResult query_map(const MapSnapshot& view, const MapQuery& query,
                                       const TileHistory* history = nullptr);

/// A state of a map: versions count in each map anew.
struct MapVersion {
  std::uint64_t map_id = 0;
  std::uint64_t version = 0;
};

/// What a continuation was made from.
[[nodiscard]] std::optional<MapVersion> continued_map(const std::string& continuation);

}  // namespace stillmap
