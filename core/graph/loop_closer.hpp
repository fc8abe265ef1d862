#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/geodesy/earth_alignment.hpp"
#include "core/geodesy/gnss_track.hpp"
#include "core/graph/earlier_map.hpp"
#include "core/graph/pose_graph.hpp"
#include "core/graph/position_chains.hpp"
#include "core/graph/submap.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/trajectory.hpp"

namespace stillmap {

struct LoopClosingConfig {
  SubmapConfig submap;
  DriftModel drift;
  /// Nodes of the graph are at least this far apart along the way, or turned [m, rad].
  double node_spacing_m = 1.0;
  double node_turn_rad = 0.35;
  /// A place is revisited when so much way lies between: within it odometry itself has the old
  /// points in its local map [m].
  double min_way_between_m = 80.0;
  /// A place that the lidar never left by this much was in the odometry's local map all the time:
  /// where odometry and closure agree to `min_jump_m` there, odometry is the better one [m].
  double min_excursion_m = 80.0;
  double min_jump_m = 0.3;
  /// Submaps whose keys are this near may show the same place [m].
  double max_distance_m = 15.0;
  /// So many of the nearest are tried.
  std::size_t max_candidates = 2;
  SubmapMatchConfig match;
  /// A jump larger than this needs a second closure that agrees to `agreement_m` and
  /// `agreement_rad`, from one of the next submaps.
  double max_single_jump_m = 1.0;
  double agreement_m = 0.6;
  double agreement_rad = 0.02;
  std::size_t agreement_submaps = 3;
  /// A street that a bridge leads over, and the storeys of a car park, look alike: one that moves
  /// the later place up or down by more than this needs closures that agree on so much of the plan,
  /// which neither has, from one of so many next submaps; not where both show that nothing leads
  /// over the other's way [m].
  double max_height_jump_m = 1.0;
  double level_extent_m = 80.0;
  std::size_t level_agreement_submaps = 8;
  /// Cauchy kernel, and the squared error (of six degrees of freedom) above which the graph denies
  /// a closure.
  double loop_scale = 2.5;
  double max_squared_error = 60.0;
  /// Positions count once on so much way, and once on so many of their standard deviations: errors
  /// of a satellite receiver stay the same for a minute [m].
  double position_spacing_m = 5.0;
  double position_spacing_sigmas = 10.0;
  /// See PoseGraphConfig; and the squared error (of three) above which one is in doubt.
  double position_scale = 1.5;
  double position_slack = 1.0;
  double max_squared_position_error = 25.0;
  /// More than this share of them are not reflections: odometry is worse than it says.
  double max_doubted_share = 0.25;
  /// Where more than this share are in doubt in the end, none is used, until there are so many
  /// times as many: fixes are of another time, or of another drive.
  double max_unused_share = 0.5;
  double more_positions = 1.25;
  EarthAlignmentConfig earth;
  /// See LoopCloser::is_off_earlier_map [m].
  double max_way_off_m = 60.0;
  std::size_t max_missed_submaps = 4;
};

/// A revisited place.
struct LoopClosure {
  /// Scans of the keys, as numbers of `LoopCloser::add` calls, and the motion between them.
  std::size_t from_scan = 0;
  std::size_t to_scan = 0;
  Eigen::Isometry3d T_from_to = Eigen::Isometry3d::Identity();
  /// How well the submaps lie on one another: see OdometryResult.
  double fit = 0.0;
  double upright_fit = 0.0;
  double overlap = 0.0;
  /// Score of the second best place over that of the best.
  double runner_up = 0.0;
  /// How far it moved the later place against the graph until then [m].
  double jump_m = 0.0;
  /// Why it was not believed; empty where it was.
  std::string refusal;
};

/// A closure that somebody knows to be wrong: scans by the numbers of `LoopCloser::add`.
struct DeniedLoop {
  std::size_t from_scan = 0;
  std::size_t to_scan = 0;
};

/// Cuts a drive into submaps, finds places that it comes back to, and corrects its poses by a pose
/// graph, in which measured positions take part, too, once it is known where the map lies. Poses go
/// in as odometry has them, in order; odometry never hears of the correction. The same scans give
/// the same result. NOT thread safe.
class LoopCloser {
 public:
  explicit LoopCloser(const LoopClosingConfig& config)
      : config_(config),
        builder_(config.submap),
        positions_(config.position_spacing_m, config.position_spacing_sigmas) {}
  /// Of a drive that begins in a map made earlier, and goes on in it: poses are in that map's
  /// frame, of which nothing moves. Submaps that are found in it are held there, and what odometry
  /// drifts by outside of it is made up for where the drive comes back.
  LoopCloser(const LoopClosingConfig& config, EarlierMap earlier)
      : config_(config),
        earlier_(std::move(earlier)),
        builder_(config.submap),
        positions_(config.position_spacing_m, config.position_spacing_sigmas) {}

  /// From now on nothing joins the submaps of these scans, nor their neighbours on the way: what
  /// looks alike does so from there, too. The scans may be still to come.
  void deny(const DeniedLoop& denied) { denied_.push_back(denied); }

  /// The next scan of the drive. One that is not confirmed has a pose, but no part in submaps.
  /// `number`: what DeniedLoop names it by, larger than that of the last one.
  void add(const LabelledScan& scan, const Eigen::Isometry3d& T_odom_lidar, bool is_confirmed,
           std::size_t number);
  /// The same, numbered by the calls.
  void add(const LabelledScan& scan, const Eigen::Isometry3d& T_odom_lidar, bool is_confirmed) {
    add(scan, T_odom_lidar, is_confirmed, T_odom_lidar_.size());
  }
  /// The next confirmed scan is where what was seen near it before has it: nothing tells the way
  /// there from the scans until now.
  void go_on_elsewhere();
  /// A position of one of the scans added so far. Those of scans before the first node say nothing.
  void add(const PositionAtScan& position);
  /// Instead of those until now, which were of another origin or at other times.
  void replace_positions(std::span<const PositionAtScan> positions);
  /// The drive ended: its last stretch becomes a submap, too.
  void finish();

  /// Those that are believed.
  [[nodiscard]] const std::vector<LoopClosure>& closures() const { return closures_; }
  [[nodiscard]] const std::vector<LoopClosure>& refused() const { return refused_; }
  /// Whether closures, an earlier map or positions correct the poses.
  [[nodiscard]] bool is_corrected() const {
    return !closures_.empty() || !anchors_.empty() || T_enu_map_.has_value();
  }
  /// Where the map lies in the frame of the positions; nothing while that is not known.
  [[nodiscard]] const std::optional<Eigen::Isometry3d>& T_enu_map() const { return T_enu_map_; }
  /// Positions in all, and how many of them contradict the others, or the rest of the graph puts
  /// elsewhere.
  struct PositionCounts {
    std::size_t used = 0;
    std::size_t in_doubt = 0;
  };
  [[nodiscard]] PositionCounts position_counts() const;
  /// Whether too many of them contradict odometry for any to be used.
  [[nodiscard]] bool are_positions_refused() const;
  /// Poses of all scans added so far, corrected. Without closures and positions: as they were.
  [[nodiscard]] std::vector<Eigen::Isometry3d> corrected_poses() const;
  /// The same with these poses of the graph's nodes, in whatever frame they are.
  [[nodiscard]] std::vector<Eigen::Isometry3d> poses_by(
      const std::vector<Eigen::Isometry3d>& T_map_node) const;
  [[nodiscard]] const PoseGraph& graph() const { return graph_; }
  /// A node of the graph.
  struct Node {
    /// Number of its scan, and the way of the lidar until there [m].
    std::size_t scan = 0;
    double way_m = 0.0;
  };
  [[nodiscard]] const std::vector<Node>& nodes() const { return nodes_; }
  [[nodiscard]] const std::vector<PlacedSubmap>& submaps() const { return submaps_; }
  /// Memory of the submaps.
  [[nodiscard]] std::size_t submap_bytes() const;
  /// Submaps that a closure joins, and the number of its edge in the graph.
  struct Joint {
    std::size_t from = 0;
    std::size_t to = 0;
    std::size_t edge = 0;
  };
  /// Of each of `closures()`.
  [[nodiscard]] const std::vector<Joint>& joints() const { return joints_; }
  /// A submap that was found in the earlier map, and the number of its edge in the graph.
  struct Anchor {
    std::size_t submap = 0;
    std::size_t edge = 0;
  };
  [[nodiscard]] const std::vector<Anchor>& anchors() const { return anchors_; }
  /// Whether odometry may have drifted away from the earlier map: it is some way since it was found
  /// there. Not once so many submaps since then had the map beside them and were not found: then
  /// it may be that none will be.
  [[nodiscard]] bool is_off_earlier_map() const;
  /// Whether the newest submap lies where its place was seen before.
  [[nodiscard]] bool is_newest_submap_joined() const;

 private:
  /// A closure between submaps, or of one with the earlier map, before it is believed.
  struct Candidate {
    /// Nothing: the earlier map.
    std::optional<std::size_t> from;
    std::size_t to = 0;
    LoopClosure closure;
    PoseEdge edge;
    /// Both submaps show that nothing leads over the other's way: neither lies over the other.
    bool is_open_above = false;
  };

  void add_node(std::size_t scan, const Eigen::Isometry3d& T_odom_lidar);
  /// Begins a submap at a node that hangs on the nearest one.
  void begin_elsewhere(std::size_t scan, const Eigen::Isometry3d& T_odom_lidar);
  void close_submap();
  /// Looks for the submap in the earlier map.
  void find_in_earlier_map(std::size_t submap);
  /// Of drift, from where the drive began in the earlier map or was last found in it [m].
  [[nodiscard]] double way_from_earlier_map_m(std::size_t submap) const;
  void find_loops(std::size_t to);
  [[nodiscard]] std::vector<std::size_t> candidates(std::size_t to,
                                                    const std::vector<double>& ways_m) const;
  /// Way to every submap along the graph, closures being short cuts [m].
  [[nodiscard]] std::vector<double> ways_from(std::size_t submap) const;
  /// How far the lidar went away from the one place before it came to the other [m].
  [[nodiscard]] double excursion_m(std::size_t from, std::size_t to) const;
  [[nodiscard]] std::optional<Candidate> verify(std::size_t from, std::size_t to, double way_m);
  /// Places of the lidar along a submap, in its frame [m].
  [[nodiscard]] std::vector<Eigen::Vector3d> way_along(const PlacedSubmap& placed) const;
  /// Whether each of the two would show what leads over the way of the other, and shows nothing.
  [[nodiscard]] bool are_open_above(const PlacedSubmap& a, const PlacedSubmap& b,
                                    const Eigen::Isometry3d& T_a_b,
                                    const Eigen::Isometry3d& T_a_b_expected) const;
  [[nodiscard]] bool is_denied(std::size_t from, std::size_t to) const;
  /// Whether the scan of this number is of this submap or one of its neighbours.
  [[nodiscard]] bool is_about(std::size_t number, std::size_t submap) const;
  void judge(Candidate candidate);
  /// Where a closure would put the map's frame of the later place.
  [[nodiscard]] Eigen::Isometry3d correction_by(const Candidate& candidate) const {
    return graph_.T_map_node[candidate.edge.from] * candidate.edge.T_from_to *
           graph_.T_map_node[candidate.edge.to].inverse();
  }
  [[nodiscard]] bool leads_to_other_level(const Candidate& candidate) const;
  /// Those that wait and agree with it, by their places among them; nothing where they are too few.
  [[nodiscard]] std::vector<std::size_t> enough_agreeing(const Candidate& candidate) const;
  void refuse_what_waits_too_long(std::size_t to);
  void accept(Candidate candidate);
  /// Keeps a refusal for who asks, of what joins submaps.
  void refuse(Candidate candidate, const char* why);
  /// Whether the rest of the graph denies this edge.
  [[nodiscard]] bool is_denied_by_graph(std::size_t edge) const;
  void erase_edge(std::size_t edge);
  /// Has the new positions take part, once it is known where the map lies.
  void use_positions();
  /// Of those in the graph.
  [[nodiscard]] std::size_t positions_in_doubt() const;
  /// More than this share of them.
  [[nodiscard]] bool are_too_many_in_doubt(double share) const;
  /// Without those of the graph, until there are many more.
  void refuse_positions();
  /// Without those of the graph, of which it knew where the map lies.
  void drop_positions();
  /// Poses of the nodes, and where the map lies.
  void place_nodes();
  /// By the positions, too, with their kernel so many times as wide as it is to be.
  void place_by_positions(double width);
  void take_graph(PoseGraph graph);
  /// Solves, and takes out what the graph denies.
  void solve();
  [[nodiscard]] Eigen::Isometry3d T_map_submap(const PlacedSubmap& placed) const {
    return graph_.T_map_node[placed.submap.key_node] * placed.submap.T_submap_key.inverse();
  }

  LoopClosingConfig config_;
  std::optional<EarlierMap> earlier_;
  SubmapBuilder builder_;
  std::vector<Eigen::Isometry3d> T_odom_lidar_;
  /// Of the scans until each one, those that were not confirmed.
  std::vector<std::size_t> unconfirmed_;
  /// Of the scans.
  std::vector<std::size_t> numbers_;
  std::vector<Node> nodes_;
  std::size_t first_node_of_submap_ = 0;
  bool is_elsewhere_ = false;
  PoseGraph graph_;
  std::vector<PlacedSubmap> submaps_;
  /// Those that wait for a second one.
  std::deque<Candidate> pending_;
  std::vector<LoopClosure> closures_;
  std::vector<Joint> joints_;
  std::vector<Anchor> anchors_;
  /// Since the last of them.
  std::size_t missed_submaps_ = 0;
  std::vector<LoopClosure> refused_;
  std::vector<DeniedLoop> denied_;
  PositionChains positions_;
  std::optional<Eigen::Isometry3d> T_enu_map_;
  /// Positions that were in doubt when the graph was last placed by all of them.
  std::optional<std::size_t> settled_doubts_;
  /// So many there were when too many of them were in doubt.
  std::size_t refused_positions_ = 0;
};

}  // namespace stillmap
