#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "core/graph/pose_graph.hpp"
#include "core/graph/submap.hpp"
#include "core/graph/upright_image.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/trajectory.hpp"
#include "core/odometry/odometry_state.hpp"

namespace stillmap {

/// How far odometry may have gone astray: what a loop closure must not contradict.
struct DriftModel {
  /// Of a way, along with what any closure may be off [m].
  double share_of_way = 0.01;
  double offset_m = 2.0;
  double max_m = 25.0;
  /// Of the heading [rad], [rad/m].
  double heading_rad = 0.026;
  double heading_rad_per_m = 0.00006;
  double max_heading_rad = 0.2;
  /// Standard deviations of the odometry over a way of one metre: they grow with its root.
  double translation_m = 0.01;
  double rotation_rad = 0.0004;
};

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
  /// What a registration must reach (see OdometryResult).
  double min_overlap = 0.5;
  double min_fit = 0.4;
  double min_upright_fit = 0.5;
  /// The runner-up of the plan alignment may reach this share of the best one's score; above it, it
  /// must lead to the same pose, or fit worse by `min_fit_margin`.
  double max_runner_up = 0.75;
  double min_fit_margin = 0.08;
  /// Registration moves what the plan alignment found by at most this.
  double max_refinement_m = 1.5;
  double max_refinement_rad = 0.06;
  /// A jump larger than this needs a second closure that agrees to `agreement_m` and
  /// `agreement_rad`, from one of the next submaps.
  double max_single_jump_m = 1.0;
  double agreement_m = 0.6;
  double agreement_rad = 0.02;
  std::size_t agreement_submaps = 3;
  /// Cauchy kernel, and the squared error (of six degrees of freedom) above which the graph denies
  /// a closure.
  double loop_scale = 2.5;
  double max_squared_error = 60.0;
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

/// Cuts a drive into submaps, finds places that it comes back to, and corrects its poses by a pose
/// graph. Poses go in as odometry has them, in order; odometry never hears of the correction. The
/// same scans give the same result. NOT thread safe.
class LoopCloser {
 public:
  explicit LoopCloser(const LoopClosingConfig& config) : config_(config), builder_(config.submap) {}

  /// The next scan of the drive. One that is not confirmed has a pose, but no part in submaps.
  void add(const LabelledScan& scan, const Eigen::Isometry3d& T_odom_lidar, bool is_confirmed);
  /// The drive ended: its last stretch becomes a submap, too.
  void finish();

  /// Those that are believed.
  [[nodiscard]] const std::vector<LoopClosure>& closures() const { return closures_; }
  [[nodiscard]] const std::vector<LoopClosure>& refused() const { return refused_; }
  /// Poses of all scans added so far, corrected. Without closures: as they were.
  [[nodiscard]] std::vector<Eigen::Isometry3d> corrected_poses() const;
  [[nodiscard]] const PoseGraph& graph() const { return graph_; }
  [[nodiscard]] std::size_t submap_count() const { return submaps_.size(); }
  /// Memory of the submaps.
  [[nodiscard]] std::size_t submap_bytes() const;

 private:
  struct PlacedSubmap {
    Submap submap;
    UprightImage image;
  };
  /// A closure between submaps, before it is believed.
  struct Candidate {
    std::size_t from = 0;
    std::size_t to = 0;
    LoopClosure closure;
    PoseEdge edge;
  };
  struct Node {
    std::size_t scan = 0;
    double way_m = 0.0;
  };

  void add_node(std::size_t scan, const Eigen::Isometry3d& T_odom_lidar);
  void close_submap();
  void find_loops(std::size_t to);
  [[nodiscard]] std::vector<std::size_t> candidates(std::size_t to,
                                                    const std::vector<double>& ways_m) const;
  /// Way to every submap along the graph, closures being short cuts [m].
  [[nodiscard]] std::vector<double> ways_from(std::size_t submap) const;
  /// How far the lidar went away from the one place before it came to the other [m].
  [[nodiscard]] double excursion_m(std::size_t from, std::size_t to) const;
  [[nodiscard]] std::optional<Candidate> verify(std::size_t from, std::size_t to, double way_m);
  /// Whether what was found is told from its runner-up; fills in what it is judged by.
  [[nodiscard]] std::string fault_of(const OdometryResult& found, LoopClosure& closure) const;
  void judge(Candidate candidate);
  void accept(Candidate candidate);
  /// Solves, and takes out what the graph denies.
  void solve();
  [[nodiscard]] Eigen::Isometry3d T_map_submap(const PlacedSubmap& placed) const {
    return graph_.T_map_node[placed.submap.key_node] * placed.submap.T_submap_key.inverse();
  }

  LoopClosingConfig config_;
  SubmapBuilder builder_;
  std::vector<Eigen::Isometry3d> T_odom_lidar_;
  std::vector<Node> nodes_;
  std::size_t first_node_of_submap_ = 0;
  PoseGraph graph_;
  std::vector<PlacedSubmap> submaps_;
  /// Those that wait for a second one.
  std::deque<Candidate> pending_;
  std::vector<LoopClosure> closures_;
  /// Submaps and number of the graph's edge of each closure.
  struct Joint {
    std::size_t from, to, edge;
  };
  std::vector<Joint> joints_;
  std::vector<LoopClosure> refused_;
};

}  // namespace stillmap
