#include <algorithm>
#include <utility>

#include "core/graph/loop_closer.hpp"

// What LoopCloser does with measured positions.

namespace stillmap {

void LoopCloser::add(const PositionAtScan& position) {
  if (nodes_.empty() || position.scan < nodes_.front().scan) return;
  const auto after = std::ranges::upper_bound(nodes_, position.scan, {}, &Node::scan);
  const auto node = static_cast<std::size_t>(after - nodes_.begin()) - 1;
  const Eigen::Isometry3d T_node_scan =
      T_odom_lidar_[nodes_[node].scan].inverse() * T_odom_lidar_[position.scan];
  const PositionMeasurement measured{.node = node,
                                     .point_node = T_node_scan * position.antenna_lidar,
                                     .position_enu = position.position_enu,
                                     .information = position.covariance_enu.inverse()};
  positions_.add({.measured = measured,
                  .point_odom = T_odom_lidar_[position.scan] * position.antenna_lidar,
                  .way_m = nodes_[node].way_m,
                  .unconfirmed_scans = unconfirmed_[position.scan]});
}

void LoopCloser::replace_positions(std::span<const PositionAtScan> positions) {
  positions_.clear();
  refused_positions_ = 0;
  for (const PositionAtScan& position : positions) add(position);
  const bool was_bent = T_enu_map_.has_value();
  drop_positions();
  use_positions();
  // What they bent goes back.
  if (was_bent && !T_enu_map_) solve();
}

void LoopCloser::drop_positions() {
  settled_doubts_.reset();
  T_enu_map_.reset();
  graph_.positions.clear();
  graph_.T_enu_map.setIdentity();
}

LoopCloser::PositionCounts LoopCloser::position_counts() const {
  const std::size_t others = positions_.disbelieved();
  if (!T_enu_map_)
    return {.used = refused_positions_ + others, .in_doubt = refused_positions_ + others};
  return {.used = graph_.positions.size() + others, .in_doubt = positions_in_doubt() + others};
}

bool LoopCloser::are_positions_refused() const {
  if (refused_positions_ > 0) return true;
  // They make no chain that is long enough to say where the map lies.
  const std::size_t others = positions_.disbelieved();
  return !T_enu_map_ && others >= config_.earth.min_points &&
         static_cast<double>(others) >
             config_.max_unused_share * static_cast<double>(others + positions_.believed_count());
}

std::size_t LoopCloser::positions_in_doubt() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(graph_.positions, [&](const PositionMeasurement& position) {
        return squared_error(position, graph_.T_map_node[position.node], *T_enu_map_) >
               config_.max_squared_position_error;
      }));
}

void LoopCloser::use_positions() {
  const std::span<const PositionMeasurement> believed = positions_.believed();
  const auto is_node = [](const PositionMeasurement& a, const PositionMeasurement& b) {
    return a.node == b.node;
  };
  const std::size_t known = graph_.positions.size();
  const bool goes_on =
      known <= believed.size() &&
      std::equal(graph_.positions.begin(), graph_.positions.end(), believed.begin(), is_node);
  if (goes_on && known == believed.size()) return;
  if (static_cast<double>(believed.size()) <
      config_.more_positions * static_cast<double>(refused_positions_))
    return;
  // More positions of another chain than of the one until now.
  const bool was_bent = !goes_on && T_enu_map_.has_value();
  if (was_bent) drop_positions();
  std::vector<PointOnEarth> points;
  for (const PositionMeasurement& position : believed) {
    points.push_back({graph_.T_map_node[position.node] * position.point_node, position.position_enu,
                      horizontal_sigma_m(position.information.inverse())});
  }
  // Of the whole way each time: within their slack positions do not turn the map.
  if (const auto T_enu_map = align_to_earth(points, config_.earth)) T_enu_map_ = T_enu_map;
  if (!T_enu_map_) {
    if (was_bent) solve();
    return;
  }
  graph_.positions.assign(believed.begin(), believed.end());
  graph_.T_enu_map = *T_enu_map_;
  solve();
}

bool LoopCloser::are_too_many_in_doubt(double share) const {
  return static_cast<double>(positions_in_doubt()) >
         share * static_cast<double>(graph_.positions.size());
}

void LoopCloser::place_nodes() {
  if (graph_.positions.empty()) {
    graph_.T_map_node = optimize(graph_, {.loop_scale = config_.loop_scale}).T_map_node;
    return;
  }
  // Nothing new is far off: the narrow kernel takes nothing for a reflection that is none.
  if (settled_doubts_ && positions_in_doubt() <= *settled_doubts_) {
    PoseGraph before = graph_;
    place_by_positions(1.0);
    // Those that are believed again must not hide as many others later.
    if (const std::size_t doubts = positions_in_doubt(); doubts <= *settled_doubts_) {
      settled_doubts_ = doubts;
      return;
    }
    take_graph(std::move(before));
  }
  settled_doubts_.reset();
  refused_positions_ = 0;
  // Where odometry has drifted far from the positions, all of them are far off, and the kernel
  // would take them for reflections: it is narrowed step by step (A. Blake and A. Zisserman,
  // "Visual reconstruction", 1987: graduated non-convexity), while those that it puts in doubt are
  // few.
  place_by_positions(1000.0);
  for (const double width : {30.0, 5.0, 1.0}) {
    PoseGraph wider = graph_;
    place_by_positions(width);
    if (!are_too_many_in_doubt(config_.max_doubted_share)) continue;
    take_graph(std::move(wider));
    if (are_too_many_in_doubt(config_.max_unused_share)) refuse_positions();
    return;
  }
  settled_doubts_ = positions_in_doubt();
}

void LoopCloser::refuse_positions() {
  refused_positions_ = graph_.positions.size();
  drop_positions();
  place_nodes();
}

void LoopCloser::place_by_positions(double width) {
  const PoseGraphConfig solver{.loop_scale = config_.loop_scale,
                               .position_scale = width * config_.position_scale,
                               .position_slack = config_.position_slack};
  PoseGraphSolution solution = optimize(graph_, solver);
  graph_.T_map_node = std::move(solution.T_map_node);
  T_enu_map_ = graph_.T_enu_map = solution.T_enu_map;
}

void LoopCloser::take_graph(PoseGraph graph) {
  graph_ = std::move(graph);
  T_enu_map_ = graph_.T_enu_map;
}

}  // namespace stillmap
