#include "core/graph/loop_closer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "core/graph/ceiling.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

/// What a closure counts as, of way, for the drift between the places that it joins [m].
constexpr double way_of_closure_m = 10.0;

PoseEdge odometry_edge(std::size_t from, std::size_t to, const Eigen::Isometry3d& T_from_to,
                       double way_m, const DriftModel& drift) {
  // A lidar that turns on the spot has no way, but errs.
  const double way = std::max(way_m, 0.3);
  Eigen::Matrix<double, 6, 1> variance;
  variance << Eigen::Vector3d::Constant(drift.translation_m * drift.translation_m * way),
      Eigen::Vector3d::Constant(drift.rotation_rad * drift.rotation_rad * way);
  return {.from = from,
          .to = to,
          .T_from_to = T_from_to,
          .information = variance.cwiseInverse().asDiagonal(),
          .is_loop = false};
}

constexpr const char* stayed_alone = "no second closure agreed with its jump";
constexpr const char* other_level = "it may be a level above or below: too little way agreed";

Submap without_points(const Submap& submap) {
  return {.key_node = submap.key_node,
          .way_m = submap.way_m,
          .T_submap_key = submap.T_submap_key,
          .points_submap = {},
          .classes = {}};
}

double angle_of(const Eigen::Isometry3d& T) { return so3_log(T.linear()).norm(); }

}  // namespace

void LoopCloser::add(const LabelledScan& scan, const Eigen::Isometry3d& T_odom_lidar,
                     bool is_confirmed, std::size_t number) {
  const std::size_t index = T_odom_lidar_.size();
  T_odom_lidar_.push_back(T_odom_lidar);
  numbers_.push_back(number);
  unconfirmed_.push_back((unconfirmed_.empty() ? 0 : unconfirmed_.back()) + (is_confirmed ? 0 : 1));
  if (!is_confirmed) return;
  if (nodes_.empty()) {
    nodes_.push_back({index, 0.0});
    graph_.T_map_node.push_back(T_odom_lidar);
  } else if (std::exchange(is_elsewhere_, false)) {
    begin_elsewhere(index, T_odom_lidar);
  } else {
    const Eigen::Isometry3d motion = T_odom_lidar_[nodes_.back().scan].inverse() * T_odom_lidar;
    if (motion.translation().norm() >= config_.node_spacing_m ||
        angle_of(motion) >= config_.node_turn_rad)
      add_node(index, T_odom_lidar);
  }
  builder_.add(scan, T_odom_lidar);
  const double begun_m = nodes_[first_node_of_submap_].way_m;
  if (nodes_.back().way_m - begun_m >= config_.submap.length_m) close_submap();
}

void LoopCloser::add_node(std::size_t scan, const Eigen::Isometry3d& T_odom_lidar) {
  const Node& last = nodes_.back();
  const Eigen::Isometry3d motion = T_odom_lidar_[last.scan].inverse() * T_odom_lidar;
  const double way_m = motion.translation().norm();
  graph_.edges.push_back(
      odometry_edge(nodes_.size() - 1, nodes_.size(), motion, way_m, config_.drift));
  graph_.T_map_node.push_back(graph_.T_map_node.back() * motion);
  nodes_.push_back({scan, last.way_m + way_m});
}

void LoopCloser::go_on_elsewhere() {
  if (nodes_.empty()) return;
  if (!builder_.empty()) close_submap();
  is_elsewhere_ = true;
}

void LoopCloser::begin_elsewhere(std::size_t scan, const Eigen::Isometry3d& T_odom_lidar) {
  const auto motion_from = [&](const Node& node) {
    return T_odom_lidar_[node.scan].inverse() * T_odom_lidar;
  };
  const auto nearest = std::ranges::min_element(
      nodes_, {}, [&](const Node& node) { return motion_from(node).translation().norm(); });
  const Eigen::Isometry3d motion = motion_from(*nearest);
  const auto from = static_cast<std::size_t>(nearest - nodes_.begin());
  graph_.edges.push_back(
      odometry_edge(from, nodes_.size(), motion, way_of_closure_m, config_.drift));
  graph_.T_map_node.push_back(graph_.T_map_node[from] * motion);
  first_node_of_submap_ = nodes_.size();
  const double way_m = motion_from(nodes_.back()).translation().norm();
  nodes_.push_back({scan, nodes_.back().way_m + way_m});
}

void LoopCloser::finish() {
  if (!builder_.empty()) {
    close_submap();
  } else {
    // Positions may have come, or been put elsewhere, after the last submap was closed.
    use_positions();
  }
  for (Candidate& candidate : pending_) {
    const char* const why = leads_to_other_level(candidate) ? other_level : stayed_alone;
    refuse(std::move(candidate), why);
  }
  pending_.clear();
}

void LoopCloser::close_submap() {
  const std::size_t key = (first_node_of_submap_ + nodes_.size() - 1) / 2;
  Submap submap = builder_.take(T_odom_lidar_[nodes_[key].scan]);
  submap.key_node = key;
  submap.way_m = nodes_[key].way_m;
  submaps_.emplace_back(std::move(submap));
  first_node_of_submap_ = nodes_.size() - 1;
  find_in_earlier_map(submaps_.size() - 1);
  find_loops(submaps_.size() - 1);
  use_positions();
}

void LoopCloser::find_in_earlier_map(std::size_t submap) {
  if (!earlier_) return;
  const Submap& own = submaps_[submap].submap;
  // Node 0 is held anyway.
  if (own.key_node == 0) return;
  const auto found =
      earlier_->match(own, graph_.T_map_node[own.key_node], way_from_earlier_map_m(submap));
  if (!found) return;
  // Beside the map, but not in it, there is little that could meet.
  if (found->match.overlap >= config_.match.min_overlap) ++missed_submaps_;
  if (!found->match.refusal.empty()) return;
  LoopClosure closure;
  closure.jump_m = found->match.jump_m;
  // Node 0 stays where it is, as the map does.
  judge({.from = std::nullopt,
         .to = submap,
         .closure = closure,
         .edge = {.from = 0,
                  .to = own.key_node,
                  .T_from_to = graph_.T_map_node[0].inverse() * found->T_map_key,
                  .information = found->match.key_information,
                  .is_loop = true}});
}

bool LoopCloser::is_off_earlier_map() const {
  if (!earlier_ || nodes_.empty() || missed_submaps_ >= config_.max_missed_submaps) return false;
  const double found_m = anchors_.empty() ? 0.0 : submaps_[anchors_.back().submap].submap.way_m;
  return nodes_.back().way_m - found_m > config_.max_way_off_m;
}

double LoopCloser::way_from_earlier_map_m(std::size_t submap) const {
  const std::vector<double> ways_m = ways_from(submap);
  double way_m = ways_m[0] + submaps_[0].submap.way_m;
  for (const Anchor& anchor : anchors_) way_m = std::min(way_m, ways_m[anchor.submap]);
  return way_m;
}

void LoopCloser::find_loops(std::size_t to) {
  // One that was found in the earlier map is where it belongs.
  if (!submaps_[to].submap.points_submap.empty()) {
    const std::vector<double> ways_m = ways_from(to);
    for (const std::size_t from : candidates(to, ways_m)) {
      if (auto candidate = verify(from, to, ways_m[from])) judge(*std::move(candidate));
    }
  }
  refuse_what_waits_too_long(to);
}

std::vector<std::size_t> LoopCloser::candidates(std::size_t to,
                                                const std::vector<double>& ways_m) const {
  const Eigen::Vector3d at_map = T_map_submap(submaps_[to]).translation();
  std::vector<std::pair<double, std::size_t>> near;
  for (std::size_t from = 0; from < to; ++from) {
    if (submaps_[to].submap.way_m - submaps_[from].submap.way_m < config_.min_way_between_m) break;
    if (submaps_[from].submap.points_submap.empty()) continue;
    const Eigen::Vector3d way = T_map_submap(submaps_[from]).translation() - at_map;
    const double reach_m = window_after(config_.drift, ways_m[from]).reach_m;
    // Of storeys, that which is nearest in height.
    if (way.head<2>().norm() < config_.max_distance_m + reach_m)
      near.emplace_back(way.norm(), from);
  }
  std::ranges::sort(near);
  std::vector<std::size_t> chosen;
  for (const auto& [distance_m, from] : near)
    if (chosen.size() < config_.max_candidates) chosen.push_back(from);
  return chosen;
}

std::vector<double> LoopCloser::ways_from(std::size_t submap) const {
  std::vector<double> ways(submaps_.size(), std::numeric_limits<double>::infinity());
  ways[submap] = 0.0;
  const auto shorten = [&ways](std::size_t a, std::size_t b, double way_m) {
    const bool is_shorter = ways[a] + way_m < ways[b] || ways[b] + way_m < ways[a];
    ways[b] = std::min(ways[b], ways[a] + way_m);
    ways[a] = std::min(ways[a], ways[b] + way_m);
    return is_shorter;
  };
  for (bool is_changing = true; is_changing;) {
    is_changing = false;
    for (std::size_t i = submaps_.size() - 1; i > 0; --i)
      is_changing |= shorten(i, i - 1, submaps_[i].submap.way_m - submaps_[i - 1].submap.way_m);
    for (const Joint& joint : joints_)
      is_changing |= shorten(joint.from, joint.to, way_of_closure_m);
    for (std::size_t i = 1; i < submaps_.size(); ++i)
      is_changing |= shorten(i, i - 1, submaps_[i].submap.way_m - submaps_[i - 1].submap.way_m);
  }
  return ways;
}

std::optional<LoopCloser::Candidate> LoopCloser::verify(std::size_t from, std::size_t to,
                                                        double way_m) {
  const PlacedSubmap& a = submaps_[from];
  const PlacedSubmap& b = submaps_[to];
  const Eigen::Isometry3d T_a_b_expected = T_map_submap(a).inverse() * T_map_submap(b);
  const auto match =
      match_submaps(a, b, T_a_b_expected, window_after(config_.drift, way_m), config_.match);
  if (!match ||
      (match->jump_m < config_.min_jump_m && excursion_m(from, to) < config_.min_excursion_m))
    return std::nullopt;
  LoopClosure closure{
      .from_scan = nodes_[a.submap.key_node].scan,
      .to_scan = nodes_[b.submap.key_node].scan,
      .T_from_to = a.submap.T_submap_key.inverse() * match->T_a_b * b.submap.T_submap_key,
      .fit = match->fit,
      .upright_fit = match->upright_fit,
      .overlap = match->overlap,
      .runner_up = match->runner_up,
      .jump_m = match->jump_m,
      .refusal = is_denied(from, to) ? "denied by who maps" : match->refusal};
  if (!closure.refusal.empty()) {
    refused_.push_back(std::move(closure));
    return std::nullopt;
  }
  const PoseEdge edge{.from = a.submap.key_node,
                      .to = b.submap.key_node,
                      .T_from_to = closure.T_from_to,
                      .information = match->key_information,
                      .is_loop = true};
  return Candidate{.from = from,
                   .to = to,
                   .closure = std::move(closure),
                   .edge = edge,
                   .is_open_above = are_open_above(a, b, match->T_a_b, T_a_b_expected)};
}

std::vector<Eigen::Vector3d> LoopCloser::way_along(const PlacedSubmap& placed) const {
  const Eigen::Isometry3d T_submap_map = T_map_submap(placed).inverse();
  std::vector<Eigen::Vector3d> way;
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    if (std::abs(nodes_[n].way_m - placed.submap.way_m) > 0.5 * config_.submap.length_m) continue;
    // Nodes of a lidar that turns on the spot are at one place.
    const Eigen::Vector3d place = T_submap_map * graph_.T_map_node[n].translation();
    if (way.empty() || (place - way.back()).norm() >= 0.5 * config_.node_spacing_m)
      way.push_back(place);
  }
  return way;
}

bool LoopCloser::are_open_above(const PlacedSubmap& a, const PlacedSubmap& b,
                                const Eigen::Isometry3d& T_a_b,
                                const Eigen::Isometry3d& T_a_b_expected) const {
  // A terrace beside the street has no way over or under it.
  constexpr double max_aside_m = 5.0;
  const Eigen::Vector3d jump_m = T_a_b.translation() - T_a_b_expected.translation();
  if (jump_m.head<2>().norm() > max_aside_m) return false;
  const double height_m = std::abs(jump_m.z());
  const std::vector<Eigen::Vector3d> way_a = way_along(a);
  const std::vector<Eigen::Vector3d> way_b = way_along(b);
  const auto moved = [](std::vector<Eigen::Vector3d> way, const Eigen::Isometry3d& T) {
    for (Eigen::Vector3d& place : way) place = T * place;
    return way;
  };
  return is_open_above(a.submap, way_a, moved(way_b, T_a_b), height_m) &&
         is_open_above(b.submap, way_b, moved(way_a, T_a_b.inverse()), height_m);
}

bool LoopCloser::is_denied(std::size_t from, std::size_t to) const {
  return std::ranges::any_of(denied_, [&](const DeniedLoop& denied) {
    return is_about(denied.from_scan, from) && is_about(denied.to_scan, to);
  });
}

bool LoopCloser::is_about(std::size_t number, std::size_t submap) const {
  const auto key_number = [this](std::size_t s) {
    return numbers_[nodes_[submaps_[s].submap.key_node].scan];
  };
  const std::size_t first = submap == 0 ? 0 : key_number(submap - 1);
  // Of the newest one half is behind its key, and the next key as far ahead of its end.
  const std::size_t last = submap + 1 < submaps_.size()
                               ? key_number(submap + 1)
                               : 2 * numbers_[nodes_.back().scan] - key_number(submap);
  return first <= number && number <= last;
}

double LoopCloser::excursion_m(std::size_t from, std::size_t to) const {
  const std::size_t first = submaps_[from].submap.key_node;
  const Eigen::Vector3d left_map = graph_.T_map_node[first].translation();
  double excursion = 0.0;
  for (std::size_t n = first; n < submaps_[to].submap.key_node; ++n)
    excursion = std::max(excursion, (graph_.T_map_node[n].translation() - left_map).norm());
  return excursion;
}

void LoopCloser::judge(Candidate candidate) {
  if (candidate.closure.jump_m <= config_.max_single_jump_m) return accept(std::move(candidate));
  const std::vector<std::size_t> agreeing = enough_agreeing(candidate);
  if (agreeing.empty()) return pending_.push_back(std::move(candidate));
  std::vector<Candidate> believed;
  for (const std::size_t k : agreeing) believed.push_back(std::move(pending_[k]));
  for (auto k = agreeing.rbegin(); k != agreeing.rend(); ++k)
    pending_.erase(pending_.begin() + static_cast<std::ptrdiff_t>(*k));
  for (Candidate& other : believed) accept(std::move(other));
  accept(std::move(candidate));
}

bool LoopCloser::leads_to_other_level(const Candidate& candidate) const {
  if (candidate.is_open_above) return false;
  const Eigen::Vector3d at_map = graph_.T_map_node[candidate.edge.to].translation();
  const double height_m = (correction_by(candidate) * at_map - at_map).z();
  return std::abs(height_m) > config_.max_height_jump_m;
}

std::vector<std::size_t> LoopCloser::enough_agreeing(const Candidate& candidate) const {
  const auto place = [this](const Candidate& c) -> Eigen::Vector3d {
    return graph_.T_map_node[c.edge.to].translation();
  };
  const auto agree = [&](const Candidate& later, const Candidate& other) {
    const Eigen::Isometry3d a = correction_by(later);
    const Eigen::Isometry3d b = correction_by(other);
    const Eigen::Vector3d at_map = place(later);
    return later.to != other.to && (a * at_map - b * at_map).norm() <= config_.agreement_m &&
           angle_of(a.inverse() * b) <= config_.agreement_rad;
  };
  // From one submap to the next odometry drifts by less than is tolerated, on 80 m maybe not: there
  // it is enough that each agrees with the next.
  const bool needs_extent = leads_to_other_level(candidate);
  std::vector<std::size_t> agreeing;
  double extent_m = 0.0;
  for (std::size_t k = pending_.size(); k-- > 0;) {
    const auto agrees = [&](std::size_t later) { return agree(pending_[later], pending_[k]); };
    // One that shows something above waits for more of the way: what is high and open itself is
    // no witness of it.
    if (candidate.is_open_above && leads_to_other_level(pending_[k])) continue;
    if (pending_[k].to == candidate.to ||
        !(agree(candidate, pending_[k]) || (needs_extent && std::ranges::any_of(agreeing, agrees))))
      continue;
    agreeing.push_back(k);
    extent_m = std::max(extent_m, (place(pending_[k]) - place(candidate)).head<2>().norm());
  }
  std::ranges::reverse(agreeing);
  if (agreeing.empty()) return {};
  if (!needs_extent) return {agreeing.front()};
  return extent_m >= config_.level_extent_m ? agreeing : std::vector<std::size_t>{};
}

void LoopCloser::refuse_what_waits_too_long(std::size_t to) {
  for (auto candidate = pending_.begin(); candidate != pending_.end();) {
    const bool is_other_level = leads_to_other_level(*candidate);
    const std::size_t submaps =
        is_other_level ? config_.level_agreement_submaps : config_.agreement_submaps;
    if (candidate->to + submaps > to) {
      ++candidate;
      continue;
    }
    refuse(std::move(*candidate), is_other_level ? other_level : stayed_alone);
    candidate = pending_.erase(candidate);
  }
}

void LoopCloser::accept(Candidate candidate) {
  const std::size_t edge = graph_.edges.size();
  graph_.edges.push_back(candidate.edge);
  if (candidate.from) {
    joints_.push_back({*candidate.from, candidate.to, edge});
    closures_.push_back(std::move(candidate.closure));
  } else {
    anchors_.push_back({candidate.to, edge});
  }
  solve();
  if (candidate.from || anchors_.empty() || anchors_.back().submap != candidate.to) return;
  missed_submaps_ = 0;
  // Who comes back is found in the earlier map.
  submaps_[candidate.to] = PlacedSubmap(without_points(submaps_[candidate.to].submap));
}

bool LoopCloser::is_newest_submap_joined() const {
  if (submaps_.empty()) return false;
  const std::size_t newest = submaps_.size() - 1;
  return (!anchors_.empty() && anchors_.back().submap == newest) ||
         (!joints_.empty() && joints_.back().to == newest);
}

void LoopCloser::refuse(Candidate candidate, const char* why) {
  if (!candidate.from) return;
  candidate.closure.refusal = why;
  refused_.push_back(std::move(candidate.closure));
}

void LoopCloser::solve() {
  place_nodes();
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const std::size_t edge = joints_[k].edge;
    if (!is_denied_by_graph(edge)) continue;
    closures_[k].refusal = "the rest of the graph denies it";
    refused_.push_back(std::move(closures_[k]));
    closures_.erase(closures_.begin() + static_cast<std::ptrdiff_t>(k));
    joints_.erase(joints_.begin() + static_cast<std::ptrdiff_t>(k));
    erase_edge(edge);
    return solve();
  }
  for (std::size_t k = 0; k < anchors_.size(); ++k) {
    const std::size_t edge = anchors_[k].edge;
    if (!is_denied_by_graph(edge)) continue;
    anchors_.erase(anchors_.begin() + static_cast<std::ptrdiff_t>(k));
    erase_edge(edge);
    return solve();
  }
}

bool LoopCloser::is_denied_by_graph(std::size_t number) const {
  const PoseEdge& edge = graph_.edges[number];
  return squared_error(edge, graph_.T_map_node[edge.from], graph_.T_map_node[edge.to],
                       EdgeError::geodesic) >= config_.max_squared_error;
}

void LoopCloser::erase_edge(std::size_t edge) {
  graph_.edges.erase(graph_.edges.begin() + static_cast<std::ptrdiff_t>(edge));
  for (Joint& joint : joints_)
    if (joint.edge > edge) --joint.edge;
  for (Anchor& anchor : anchors_)
    if (anchor.edge > edge) --anchor.edge;
}

std::vector<Eigen::Isometry3d> LoopCloser::corrected_poses() const {
  return is_corrected() ? poses_by(graph_.T_map_node) : T_odom_lidar_;
}

std::vector<Eigen::Isometry3d> LoopCloser::poses_by(
    const std::vector<Eigen::Isometry3d>& T_map_node) const {
  std::vector<Eigen::Isometry3d> poses = T_odom_lidar_;
  for (std::size_t n = 0; n < nodes_.size(); ++n) {
    const std::size_t first = nodes_[n].scan;
    const bool is_last = n + 1 == nodes_.size();
    const std::size_t end = is_last ? poses.size() : nodes_[n + 1].scan;
    const Eigen::Isometry3d T_node_odom = T_odom_lidar_[first].inverse();
    // What the motion to the next node is corrected by, spread over the scans between.
    Eigen::Isometry3d rest = Eigen::Isometry3d::Identity();
    if (!is_last)
      rest = (T_map_node[n] * T_node_odom * T_odom_lidar_[end]).inverse() * T_map_node[n + 1];
    // Scans before the first node go with it.
    for (std::size_t k = n == 0 ? 0 : first; k < end; ++k) {
      const double share =
          k < first ? 0.0 : static_cast<double>(k - first) / static_cast<double>(end - first);
      poses[k] = T_map_node[n] * T_node_odom * T_odom_lidar_[k] *
                 scaled_motion(rest, is_last ? 0.0 : share);
    }
  }
  return poses;
}

std::size_t LoopCloser::submap_bytes() const {
  std::size_t bytes = 0;
  for (const PlacedSubmap& placed : submaps_) bytes += placed.bytes();
  return bytes;
}

}  // namespace stillmap
