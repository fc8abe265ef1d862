#pragma once

#include <optional>
#include <string>

#include "core/map/query/continuation.hpp"
#include "core/map/query/map_query.hpp"

namespace stillmap {

/// What cannot be answered, in words; empty when the query is fine.
[[nodiscard]] std::string query_faults(const MapSnapshot& view, const MapQuery& query);

/// Why a query does not get an answer.
struct Refusal {
  QueryStatus status;
  std::string reason;
};

/// Why the changes since the version that the client has cannot be told.
[[nodiscard]] std::optional<Refusal> since_refusal(const MapSnapshot& view,
                                                   const KnownVersion& since,
                                                   const TileHistory* history);

/// Why the token, if there is one, cannot be followed on this view.
[[nodiscard]] std::optional<Refusal> token_refusal(const MapSnapshot& view, const MapQuery& query,
                                                   const std::optional<Continuation>& token);

/// Whether the answer's voxels are larger than the map's.
[[nodiscard]] bool is_coarser_than_map(const MapSnapshot& view, double resolution_m);

/// Tells queries apart; the page size does not matter.
[[nodiscard]] std::uint64_t fingerprint(const MapQuery& query);

}  // namespace stillmap
