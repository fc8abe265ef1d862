#include "core/map/query/query_checks.hpp"

#include <cmath>
#include <sstream>

namespace stillmap {
namespace {

/// Resolutions that differ by less are the same: one came over the wire as float.
constexpr double resolution_tolerance = 1e-6;

void check_resolution(const MapSnapshot& view, const MapQuery& query, std::ostream& faults) {
  const double resolution_m = query.resolution_m;
  const double finest_m = view.voxel_size_m * (1.0 - resolution_tolerance);
  if (resolution_m != 0.0 && !(resolution_m >= finest_m && std::isfinite(resolution_m))) {
    faults << "resolution_m is " << resolution_m << "; must be 0 (the map's own) or from "
           << view.voxel_size_m << " up. ";
  } else if (query.since && is_coarser_than_map(view, resolution_m)) {
    faults << "resolution_m is " << resolution_m
           << "; with since_version it must be 0, the map's own: larger cells belong to no tile. ";
  }
}

void check_motions(const MapQuery& query, std::ostream& faults) {
  if (query.motions.none() || query.motions.test(static_cast<std::size_t>(Motion::stationary))) {
    return;
  }
  faults << "motions has no 0 (stationary), and the static map keeps nothing else; leave motions "
            "empty. ";
}

}  // namespace

bool is_coarser_than_map(const MapSnapshot& view, double resolution_m) {
  return resolution_m > view.voxel_size_m * (1.0 + resolution_tolerance);
}

std::string query_faults(const MapSnapshot& view, const MapQuery& query) {
  std::ostringstream faults;
  faults << region_faults(query.region);
  check_resolution(view, query, faults);
  check_motions(query, faults);
  if (query.max_bytes < query_voxel_bytes) {
    faults << "max_bytes is " << query.max_bytes << "; must be at least " << query_voxel_bytes
           << ", the size of one voxel. ";
  }
  return faults.str();
}

std::optional<Refusal> since_refusal(const MapSnapshot& view, const KnownVersion& since,
                                     const TileHistory* history) {
  std::ostringstream reason;
  if (since.map_id != view.map_id) {
    reason << "since_map_id is " << since.map_id << ", the map is now " << view.map_id;
  } else if (since.version > view.version) {
    reason << "since_version is " << since.version << ", the map is at version " << view.version;
  } else if (history == nullptr || since.version < history->known_since) {
    reason << "since_version is " << since.version << "; changes are remembered since version "
           << (history == nullptr ? view.version : history->known_since);
  } else {
    return std::nullopt;
  }
  reason << "; ask for everything, without since_version";
  return Refusal{QueryStatus::changes_unknown, reason.str()};
}

std::optional<Refusal> token_refusal(const MapSnapshot& view, const MapQuery& query,
                                     const std::optional<Continuation>& token) {
  if (!token) {
    return Refusal{QueryStatus::invalid_request,
                   "continuation is damaged; hand back the text of the last page as it is"};
  }
  if (token->map_id != view.map_id || token->map_version != view.version) {
    std::ostringstream reason;
    reason << "continuation is of map " << token->map_id << " version " << token->map_version
           << ", the map is now " << view.map_id << " version " << view.version
           << "; ask again without continuation";
    return Refusal{QueryStatus::stale_continuation, reason.str()};
  }
  if (token->query_fingerprint != fingerprint(query)) {
    return Refusal{QueryStatus::invalid_request,
                   "continuation is of another query; keep region, classes, motions, resolution_m "
                   "and since_version as they were on the first page"};
  }
  return std::nullopt;
}

}  // namespace stillmap
