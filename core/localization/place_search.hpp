#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <optional>
#include <span>
#include <vector>

#include "core/localization/localization_query.hpp"
#include "core/localization/place_index.hpp"

namespace stillmap {

struct PlaceSearchConfig {
  /// Poses of the coarse search are so far apart in heading [rad]; in x and y by its cells.
  double heading_step_rad = 0.05;
  /// Landmarks that the coarse and the fine search use; at most 255.
  std::size_t coarse_landmarks = 250;
  std::size_t fine_landmarks = 250;
  /// Poses that the coarse search hands to the fine one.
  std::size_t coarse_candidates = 200;
  /// Candidates are at least this far apart, or turned [m, rad].
  double spacing_m = 1.5;
  double spacing_rad = 0.12;
};

/// Where a scan may have been taken, on the ground.
struct PlaceCandidate {
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
  std::uint32_t node = 0;
  /// Share of the landmarks that fall into occupied cells.
  double score = 0.0;
};

/// Part of a map that a scan is looked for in.
struct SearchRegion {
  Eigen::Vector2d centre_map = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
  /// Of what carries the lidar, and by how much it may be turned from that.
  double heading_rad = 0.0;
  double max_turn_rad = std::numbers::pi;

  /// Also where a place is this far outside.
  [[nodiscard]] bool contains(const Eigen::Vector2d& position_map, double heading_map_rad,
                              double margin_m = 0.0, double margin_rad = 0.0) const;
};

/// The best poses of the whole index, or of a part of it, the best first, at most `count`: every
/// pose of a grid over x, y and heading is judged by how many of the scan's landmarks fall into
/// cells that the map occupies (correlative scan matching: E. Olson, ICRA 2009), and the best ones
/// again on finer cells. Exhaustive: a place is missed only where its score is low.
[[nodiscard]] std::vector<PlaceCandidate> search_places(
    const LocalizationQuery& query, const PlaceIndex& index, std::size_t count,
    const PlaceSearchConfig& config = {}, const std::optional<SearchRegion>& region = std::nullopt);

/// Pose of `upright` at a candidate.
[[nodiscard]] Eigen::Isometry3d T_map_upright(const PlaceCandidate& candidate,
                                              const LocalizationQuery& query,
                                              const PlaceIndex& index);

}  // namespace stillmap
