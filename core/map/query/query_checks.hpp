#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/map/query/map_query.hpp"

namespace stillmap {

/// Position in the answer to a query, for the next page.
struct Continuation {
  std::uint64_t map_id = 0;
  std::uint64_t map_version = 0;
  /// Hash of everything that the query asks for; the page size may change from page to page.
  std::uint64_t query_fingerprint = 0;
  /// Voxels of the whole answer.
  std::uint64_t total_voxels = 0;
  /// First voxel of the next page: its tile's position among those of the answer and its own in the
  /// tile; in a coarser answer, the positions of the strip and of the cell in it.
  std::uint64_t tile = 0;
  std::uint64_t voxel = 0;
  friend bool operator==(const Continuation&, const Continuation&) = default;
};

/// As text: hexadecimal words and a checksum against damage on the way.
[[nodiscard]] std::string to_token(const Continuation& continuation);

/// Nothing when the token is not one that to_token made.
[[nodiscard]] std::optional<Continuation> from_token(const std::string& token);

/// Every fault of the query in words; empty when it is valid.
[[nodiscard]] std::string query_faults(const MapSnapshot& view, const MapQuery& query);

/// Why a query is refused.
struct Refusal {
  QueryStatus status;
  std::string reason;
};

/// Set when the changes since the client's version are not known.
[[nodiscard]] std::optional<Refusal> since_refusal(const MapSnapshot& view,
                                                   const KnownVersion& since,
                                                   const TileHistory* history);

/// Set when the token is missing, damaged, or of another map, version or query.
[[nodiscard]] std::optional<Refusal> token_refusal(const MapSnapshot& view, const MapQuery& query,
                                                   const std::optional<Continuation>& token);

/// Whether the answer's voxels are larger than the map's.
[[nodiscard]] bool is_coarser_than_map(const MapSnapshot& view, double resolution_m);

/// Hash of everything that the query asks for but its page size and continuation.
[[nodiscard]] std::uint64_t fingerprint(const MapQuery& query);

}  // namespace stillmap
