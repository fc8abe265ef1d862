#include "core/session/map_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

constexpr const char* alone = "no second closure agreed with its jump";
constexpr const char* other_level = "it may be a level above or below: too little way agreed";

double angle_of(const Eigen::Isometry3d& T) { return so3_log(T.linear()).norm(); }

/// Along the drive, between nodes [m].
double way_between_m(const LoopCloser& drive, std::size_t a, std::size_t b) {
  return std::abs(drive.nodes()[a].way_m - drive.nodes()[b].way_m);
}

/// Where the drive has a node, by another one whose pose in the map is known.
Eigen::Isometry3d carried_to(const LoopCloser& drive, std::size_t node, std::size_t from,
                             const Eigen::Isometry3d& T_map_from) {
  const auto& T_drive_node = drive.graph().T_map_node;
  return T_map_from * T_drive_node[from].inverse() * T_drive_node[node];
}

}  // namespace

std::string MapAlignment::in_words() const {
  std::string text = std::to_string(localized) +
                     " places of it were looked for in the whole map, " + std::to_string(found) +
                     " were found, " + std::to_string(agreeing) + " of these agree";
  if (!closures.empty() || !refused.empty()) {
    text += "; " + std::to_string(closures.size()) + " of " +
            std::to_string(closures.size() + refused.size()) + " submaps fit";
    if (!refused.empty()) text += " (" + refused.back().refusal + ")";
  }
  return text;
}

MapAlignment MapAligner::align(const LoopCloser& drive, const ScanSource& scan_at,
                               const Eigen::Matrix3d& R_body_lidar) const {
  MapAlignment alignment;
  std::vector<Anchor> anchors = localize(drive, scan_at, R_body_lidar, alignment);
  if (anchors.empty()) return alignment;
  const std::vector<Found> found = close(drive, std::move(anchors), alignment);
  Solution solution{{}, found, {}};
  if (found.size() >= config_.min_closures) {
    // Odometry that drifts by more than assumed must not make closures wrong.
    for (const double odometry_scale : {1.0, 3.0, 10.0}) {
      solution = solve(drive, found, odometry_scale);
      if (static_cast<double>(solution.denied.size()) <=
          config_.max_denied * static_cast<double>(found.size()))
        break;
    }
    if (solution.believed.size() >= config_.min_closures)
      alignment.T_map_lidar = drive.poses_by(solution.T_map_node);
  }
  for (const Found& closure : solution.believed) alignment.closures.push_back(closure.closure);
  for (const Found& closure : solution.denied) alignment.refused.push_back(closure.closure);
  std::ranges::sort(alignment.closures, {}, &MapClosure::scan);
  return alignment;
}

std::vector<MapAligner::Anchor> MapAligner::localize(const LoopCloser& drive,
                                                     const ScanSource& scan_at,
                                                     const Eigen::Matrix3d& R_body_lidar,
                                                     MapAlignment& alignment) const {
  std::vector<Anchor> found;
  if (drive.nodes().empty()) return found;
  const double way_m = drive.nodes().back().way_m;
  const double spacing_m = std::max(config_.localization_spacing_m,
                                    way_m / static_cast<double>(config_.max_localizations));
  double next_m = 0.0;
  for (std::size_t node = 0; node < drive.nodes().size(); ++node) {
    if (drive.nodes()[node].way_m < next_m) continue;
    next_m = drive.nodes()[node].way_m + spacing_m;
    const LabelledScan scan = scan_at(drive.nodes()[node].scan);
    const LocalizationResult result = localizer_.localize(scan.scan, scan.labels, R_body_lidar);
    ++alignment.localized;
    if (result.status != LocalizationStatus::found) continue;
    ++alignment.found;
    found.push_back({node, result.places.front().T_map_lidar});
    std::vector<Anchor> best = agreeing(drive, found);
    alignment.agreeing = std::max(alignment.agreeing, best.size());
    if (best.size() >= config_.min_agreeing && 2 * best.size() > found.size()) return best;
  }
  return {};
}

bool MapAligner::agree(const LoopCloser& drive, const Anchor& a, const Anchor& b) const {
  const double way_m = way_between_m(drive, a.node, b.node);
  const Eigen::Isometry3d off =
      b.T_map_node.inverse() * carried_to(drive, b.node, a.node, a.T_map_node);
  return off.translation().norm() <
             config_.agreement_m + config_.earlier.drift.share_of_way * way_m &&
         angle_of(off) < config_.agreement_rad + config_.earlier.drift.heading_rad_per_m * way_m;
}

std::vector<MapAligner::Anchor> MapAligner::agreeing(const LoopCloser& drive,
                                                     const std::vector<Anchor>& found) const {
  std::vector<Anchor> same;
  std::ranges::copy_if(found, std::back_inserter(same),
                       [&](const Anchor& anchor) { return agree(drive, found.back(), anchor); });
  return same;
}

MapAligner::NextSubmap MapAligner::take_nearest(const LoopCloser& drive,
                                                const std::vector<Anchor>& anchors,
                                                std::vector<std::size_t>& open) {
  double least_m = std::numeric_limits<double>::infinity();
  NextSubmap next;
  std::size_t place = 0;
  for (std::size_t k = 0; k < open.size(); ++k) {
    for (const Anchor& anchor : anchors) {
      const double way_m =
          way_between_m(drive, drive.submaps()[open[k]].submap.key_node, anchor.node);
      if (way_m >= least_m) continue;
      least_m = way_m;
      next = {open[k], anchor};
      place = k;
    }
  }
  open.erase(open.begin() + static_cast<std::ptrdiff_t>(place));
  return next;
}

bool MapAligner::confirm(const LoopCloser& drive, const Found& a, const Found& b) const {
  const Eigen::Isometry3d off =
      a.anchor.T_map_node.inverse() *
      carried_to(drive, a.anchor.node, b.anchor.node, b.anchor.T_map_node);
  return off.translation().norm() < config_.second_agreement_m &&
         angle_of(off) < config_.second_agreement_rad;
}

std::vector<std::size_t> MapAligner::confirmed_by(const LoopCloser& drive, const Found& found,
                                                  const std::vector<Found>& waiting) const {
  // From one submap to the next odometry drifts by less than is tolerated, on 80 m maybe not: there
  // it is enough that each agrees with the next.
  const bool needs_extent = leads_to_other_level(found);
  std::vector<std::size_t> agreeing;
  const auto agrees = [&](std::size_t k) {
    const auto is_next_to = [&](std::size_t later, const Found& one) {
      return later - k <= config_.agreement_closures && confirm(drive, one, waiting[k]);
    };
    return is_next_to(waiting.size(), found) ||
           (needs_extent && std::ranges::any_of(agreeing, [&](std::size_t other) {
              return is_next_to(other, waiting[other]);
            }));
  };
  for (std::size_t k = waiting.size(); k-- > 0;)
    if (agrees(k)) agreeing.push_back(k);
  if (!needs_extent) return agreeing;
  const auto is_far_enough = [&](std::size_t k) {
    const Eigen::Vector3d apart =
        waiting[k].anchor.T_map_node.translation() - found.anchor.T_map_node.translation();
    return apart.head<2>().norm() >= config_.level_extent_m;
  };
  return std::ranges::any_of(agreeing, is_far_enough) ? agreeing : std::vector<std::size_t>{};
}

std::vector<MapAligner::Found> MapAligner::close(const LoopCloser& drive,
                                                 std::vector<Anchor> anchors,
                                                 MapAlignment& alignment) const {
  std::vector<Found> accepted;
  // Those that jumped, and wait for others that agree.
  std::vector<Found> waiting;
  const auto accept = [&](Found found) {
    anchors.push_back(found.anchor);
    accepted.push_back(std::move(found));
  };
  std::vector<std::size_t> open(drive.submaps().size());
  std::iota(open.begin(), open.end(), std::size_t{0});
  while (!open.empty()) {
    const NextSubmap next = take_nearest(drive, anchors, open);
    std::optional<Found> found = match(drive, next.submap, next.nearest);
    if (!found) continue;
    if (!found->closure.refusal.empty()) {
      alignment.refused.push_back(std::move(found->closure));
      continue;
    }
    const std::vector<std::size_t> confirmed = confirmed_by(drive, *found, waiting);
    if (jumps(*found) && confirmed.empty()) {
      waiting.push_back(*std::move(found));
      continue;
    }
    // The last first, so that the numbers of the others stay.
    for (const std::size_t k : confirmed) {
      accept(std::move(waiting[k]));
      waiting.erase(waiting.begin() + static_cast<std::ptrdiff_t>(k));
    }
    accept(*std::move(found));
  }
  for (Found& other : waiting) {
    other.closure.refusal = leads_to_other_level(other) ? other_level : alone;
    alignment.refused.push_back(std::move(other.closure));
  }
  return accepted;
}

std::optional<MapAligner::Found> MapAligner::match(const LoopCloser& drive, std::size_t submap,
                                                   const Anchor& nearest) const {
  const Submap& own = drive.submaps()[submap].submap;
  const std::size_t node = own.key_node;
  const Eigen::Isometry3d T_map_key = carried_to(drive, node, nearest.node, nearest.T_map_node);
  const auto found = map_.match(own, T_map_key, way_between_m(drive, node, nearest.node));
  if (!found) return std::nullopt;
  return Found{.closure = {.scan = drive.nodes()[node].scan,
                           .T_map_lidar = found->T_map_key,
                           .fit = found->match.fit,
                           .upright_fit = found->match.upright_fit,
                           .overlap = found->match.overlap,
                           .runner_up = found->match.runner_up,
                           .jump_m = found->match.jump_m,
                           .refusal = found->match.refusal},
               .anchor = {node, found->T_map_key},
               // Node 0 of the joint graph is the map's frame.
               .edge = {.from = 0,
                        .to = node + 1,
                        .T_from_to = found->T_map_key,
                        .information = found->match.key_information,
                        .is_loop = true},
               .height_jump_m = (found->T_map_key.translation() - T_map_key.translation()).z()};
}

MapAligner::Solution MapAligner::solve(const LoopCloser& drive, const std::vector<Found>& closures,
                                       double odometry_scale) const {
  PoseGraph graph;
  const Anchor& first = closures.front().anchor;
  graph.T_map_node.push_back(Eigen::Isometry3d::Identity());
  for (std::size_t n = 0; n < drive.nodes().size(); ++n)
    graph.T_map_node.push_back(carried_to(drive, n, first.node, first.T_map_node));
  for (PoseEdge edge : drive.graph().edges) {
    ++edge.from;
    ++edge.to;
    if (!edge.is_loop) edge.information /= odometry_scale * odometry_scale;
    graph.edges.push_back(edge);
  }
  const auto own_edges = static_cast<std::ptrdiff_t>(graph.edges.size());
  for (const Found& found : closures) graph.edges.push_back(found.edge);
  Solution solution{{}, closures, {}};
  const auto error_of = [&graph](const Found& found) {
    return squared_error(found.edge, graph.T_map_node[0], graph.T_map_node[found.edge.to],
                         EdgeError::geodesic);
  };
  while (!solution.believed.empty()) {
    graph.T_map_node = optimize(graph, {.loop_scale = config_.loop_scale}).T_map_node;
    const auto worst = std::ranges::max_element(solution.believed, {}, error_of);
    if (error_of(*worst) < config_.max_squared_error) break;
    worst->closure.refusal = "the rest of the graph denies it";
    graph.edges.erase(graph.edges.begin() + own_edges + (worst - solution.believed.begin()));
    solution.denied.push_back(*worst);
    solution.believed.erase(worst);
  }
  solution.T_map_node.assign(graph.T_map_node.begin() + 1, graph.T_map_node.end());
  return solution;
}

}  // namespace stillmap
