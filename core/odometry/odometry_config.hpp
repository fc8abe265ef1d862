#pragma once

#include <array>
#include <string>

namespace stillmap {

/// Rows of the paper's Table I: what a correspondence counts.
enum class Weighting {
  /// w = 1.
  none,
  /// w = 1 - d.
  geometric,
  /// w = 1 - alpha d - beta c, eq. (10).
  semantic,
};

/// A weighting as configurations and command lines write it.
struct NamedWeighting {
  const char* name;
  Weighting weighting;
};

/// Every weighting, in the order of Table I.
inline constexpr std::array named_weightings{NamedWeighting{"none", Weighting::none},
                                             NamedWeighting{"geometric", Weighting::geometric},
                                             NamedWeighting{"semantic", Weighting::semantic}};

/// Edge and plane points of a ring (LOAM V-A).
struct FeatureConfig {
  /// |sum over 5 neighbours to each side of (p_j - p_i)|^2 above which a point is an edge [m^2].
  /// Range noise of 2 cm alone makes 0.044 on a plane: A-LOAM's 0.1 takes noise for edges, whose
  /// "lines" follow the rings on the road and so drag the pose along with the lidar. 1.0 is five
  /// standard deviations.
  double edge_curvature_m2 = 1.0;
  /// The same sum below which a point lies on a plane [m^2].
  double plane_curvature_m2 = 0.3;
  /// Edge points taken from each of the six sectors of a ring, sharpest first.
  int edges_per_sector = 20;
  /// At most one edge point in a cube of this size [m].
  double edge_spacing_m = 0.5;
  /// At most one plane point in a cube of this size enters the local map [m].
  double map_plane_spacing_m = 0.5;
  /// At most one plane point in a cube of this size is registered [m].
  double plane_spacing_m = 0.5;
  /// Lidars with at least this many rings are registered by all their points, thinned, as lidars
  /// without rings are, from their first scan on; others begin with their rings' edges and planes.
  int min_surface_rings = 40;
  /// At most one point of such a lidar in a cube of this size enters the local map, and is
  /// registered [m].
  double map_surface_spacing_m = 0.3;
  double surface_spacing_m = 0.5;
  /// So many of these points are registered first; all where they do not fit.
  int max_surfaces = 2500;
};

/// The points that scans register against.
struct LocalMapConfig {
  /// Edge of a hash voxel [m]; neighbours are found in the 27 voxels round a point.
  double voxel_size_m = 1.0;
  int max_points_per_voxel = 20;
  /// Points nearer than this to a stored one are not added [m].
  double min_spacing_m = 0.2;
  /// Voxels farther from the lidar than this are removed [m].
  double radius_m = 100.0;
};

struct RegistrationConfig {
  /// N of eq. (5): map points that make a line or a plane.
  int neighbours = 5;
  /// A line or plane is fitted to neighbours within this distance [m].
  double max_neighbour_distance_m = 1.0;
  /// Correspondences with a larger residual are discarded [m]; the paper's [0, 1].
  double max_residual_m = 1.0;
  int max_iterations = 80;
  /// Converged when a step is below both.
  double step_translation_m = 0.001;
  double step_rotation_rad = 0.0001;
  /// Scale of the Geman-McClure kernel on top of the weights of eq. (10), not in the paper; 0
  /// switches it off. Weighting::none goes without it [m].
  double robust_scale_m = 0.1;
  /// How far the motion within a sweep differs from that since the last pose: standard deviations
  /// [m, rad], the rotation's about the map's z, and at least that: half of how much a turn changes
  /// is more. 0 metres: the motion within the sweep is not estimated.
  double sweep_translation_m = 0.03;
  double sweep_rotation_rad = 0.005;
  /// The same of the rotation about level axes of the map, whose z points up: few rings hardly tell
  /// a tilt within the sweep from one of the lidar, and what they take for it adds up [rad].
  double sweep_tilt_rad = 0.003;
  /// How far a turn about the map's z swells or ebbs within a sweep: the deviation of
  /// SweepCorrection::bend [rad], at least; in a turn it is as much as the turn. 0: turns are taken
  /// to be steady within a sweep.
  double sweep_bend_rad = 0.002;
  /// What the distance across the rings counts, 0..1, of a line that runs along a ring of the
  /// lidar: any surface shows such lines, where the lidar happens to look. Not in the paper; 1
  /// switches it off.
  double across_rings_weight = 0.1;
  /// Neighbours that are spread less than this across than along, 0..1, by their standard
  /// deviations squared, do not say how their plane is turned.
  double min_plane_width = 0.1;
  /// The same, and the neighbours, of lidars whose rings are far apart (has_sparse_rings), and of
  /// all while their local map is that of some first scans, where they are registered by surfaces:
  /// the nearest five map points mostly lie on one ring, and a plane that leans over takes the
  /// lidar along. Lines along their rings do not count at all.
  int sparse_ring_neighbours = 16;
  double sparse_ring_plane_width = 0.5;
  /// A plane counts s^2 / (s^2 + v), where v is the variance of its neighbours across it and s this
  /// [m]: a thick one is foliage, or the road with what drove over it, which stands on it and
  /// lifted every scan a little. Counts once registration is near its end: from farther off thick
  /// ones, such as corners, lead the way, too. Not in the paper; 0 switches it off.
  /// Weighting::none goes without it.
  double plane_deviation_m = 0.03;
  /// The same of lidars whose rings are far apart, with more and farther neighbours.
  double sparse_ring_plane_deviation_m = 0.05;
  /// A plane tells little of a point that lies farther than this from the middle of its neighbours,
  /// along the plane, in standard deviations of theirs (a Mahalanobis distance): the few rings of
  /// the scans before, which err together, turn the plane about themselves, and the next ring comes
  /// to lie beyond them. Not in the paper; 0 switches it off.
  double max_extrapolation = 1.5;
  /// Fewer correspondences than this give no pose.
  int min_correspondences = 50;
  /// A direction is degenerate when one metre along it (or a turn that moves points by one metre on
  /// average) changes the mean squared residual by less than this share; it then keeps the
  /// prediction. A shift is degenerate below 0.01, too, and below 0.05 where the scan lies as well
  /// beside (doubted_where_shift_fits), and followed, unless the few residuals that see it agree
  /// (witnesses_tell).
  double min_observability = 0.002;
};

/// What moves (paper II-C.2, and earlier range images).
struct MotionConfig {
  /// c_th: semantic inconsistency, eq. (9), above which a movable object is highly dynamic. Decides
  /// where `use_range_image_history` is off.
  double inconsistency_threshold = 0.6;
  /// Take movable objects out whose place an earlier scan saw free; not in the paper.
  bool use_range_image_history = true;
  /// Earlier scans that are kept for it, and how many scans lie between two of them.
  int range_image_history_size = 4;
  int range_image_history_interval = 2;
  /// An earlier ray must have gone this much farther than the point to have seen it free [m], and
  /// this share of the range.
  double free_margin_m = 0.4;
  double free_margin_share = 0.01;
  /// Share of an object's points that stand in free space above which all of it moves.
  double moving_share = 0.2;
  /// Movable points nearer than this to each other are one object [m].
  double object_gap_m = 0.5;
};

struct OdometryConfig {
  Weighting weighting = Weighting::semantic;
  /// The paper's method alone: features of rings, eq. (9) and (10) without earlier range images and
  /// without a robust kernel, one start for each registration.
  bool paper_exact = false;
  /// alpha of eq. (10), the weight of the distance; beta = 1 - alpha weighs the semantics.
  double alpha = 0.5;
  FeatureConfig features;
  LocalMapConfig local_map;
  RegistrationConfig registration;
  MotionConfig motion;
  /// The first scan in a prior map is looked for so far from its prior along x and y [m]; 0: within
  /// some metres, where it must fit well.
  double first_reach_m = 24.0;
  /// Of scans in a row that are lost, the second and one of so many after it are looked for all
  /// round, which takes seconds.
  int relocalization_interval = 5;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
  /// Without what the method that is selected does without: the paper's "no weighting" has no
  /// robust kernel either.
  [[nodiscard]] OdometryConfig with_method() const;
  /// The same for a map's first scans, which nothing else holds where traffic pulls them: with the
  /// kernel, but for the paper's own method.
  [[nodiscard]] OdometryConfig at_start() const;
};

}  // namespace stillmap
