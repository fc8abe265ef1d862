#pragma once

#include <Eigen/Core>
#include <span>
#include <string>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap {

/// Points that lie near each other in space mostly are of one thing, in whatever rows and columns
/// of the range image they are: they vote once more, after the votes in the image.
struct VoxelVoteConfig {
  /// Edge of a voxel along x and y, and its height along z [m]: flatter than wide, so that a kerb
  /// keeps its two sides apart.
  double edge_m = 0.2;
  double height_m = 0.1;
  /// What a vote counts in the voxels above and below its own, where it counts 1, and in the three
  /// at its height of each of the four columns beside.
  double neighbour_weight = 0.5;
  /// What a point's own class counts for it beside, as a share of all votes there.
  double own_weight = 0.3;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// Each point votes for its class with its confidence. It takes another class where that has more
/// votes in its voxel and those around it than its own class with `own_weight` times its confidence
/// times all votes there; ties keep its own, among others they go to the lowest class. Its
/// confidence is then the sum of the winning votes divided by the number of points that voted, both
/// weighted. Points without a class, and those further than 4,000 edges or 2,000 heights from the
/// lidar, neither vote nor change, nor does any in a cloud of more than 67 million. `labels` is as
/// long as `points_lidar`.
void vote_in_voxels(std::span<const Eigen::Vector3f> points_lidar, const VoxelVoteConfig& config,
                    PointLabels& labels);

/// A second vote, in larger voxels, of the points that the votes before left unsure. Networks doubt
/// more among real things than among the simulated ones that they have learnt from, and find more
/// people, bicycles and motorcycles there than there are.
struct UnsureVoteConfig {
  /// As VoxelVoteConfig's.
  double edge_m = 0.5;
  double height_m = 0.25;
  double neighbour_weight = 0.5;
  /// Points of a confidence below it vote again for themselves, and those of small things below
  /// the second one.
  double unsure_below = 0.35;
  double unsure_small_below = 0.5;
  /// What a vote for a small thing counts.
  double small_weight = 0.4;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// Every unsure point takes the class that has most votes in its voxel and those around it, as in
/// vote_in_voxels(): its own one of several, else the lowest. The others vote and stay as they are.
/// The confidence of a point that changes its class is the share that it has after
/// vote_in_voxels().
void vote_where_unsure(std::span<const Eigen::Vector3f> points_lidar,
                       const UnsureVoteConfig& config, PointLabels& labels);

}  // namespace stillmap
