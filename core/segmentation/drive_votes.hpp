#pragma once

#include <tsl/robin_map.h>

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/voxel_index.hpp"

namespace stillmap {

/// A place that one scan sees from afar, or thinly, others of a recorded drive see from near: all
/// of them vote on it. Defaults were chosen on real scans.
struct DriveVoteConfig {
  /// Edge of a voxel along x and y, and its height along z [m], map frame. Flat ones: what moves
  /// shares few with the ground that it leaves.
  double edge_m = 0.2;
  double height_m = 0.1;
  /// What votes count in the six voxels that share a side with a point's own, where they count 1.
  double neighbour_weight = 0.5;
  /// Scans before a scan, and after it, that vote on its points: bounds memory, and how long
  /// somebody who moved on still votes.
  std::size_t scans_each_way = 20;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// Labels of the scans of a recorded drive, after the votes of the scans around each. Every point
/// votes for its class with its confidence, squared: the sure ones decide. Points take the class
/// that has most votes round them, their own one of several, else the lowest. Their confidence is
/// then its share of all votes, where it is another class. Points without a class neither vote nor
/// change; where no other scan of its window votes, a scan keeps its labels. Memory is that of
/// twice `scans_each_way` scans. Not thread-safe.
class DriveVotes {
 public:
  /// Throws std::invalid_argument with `config.faults()`.
  explicit DriveVotes(const DriveVoteConfig& config = {});

  /// The next scan. Without a pose that can be relied on it keeps its labels, and scans before it
  /// do not vote with those after it: nothing says how they lie to each other. `labels` is as long
  /// as `points_lidar`, or empty: such a scan does not vote. Points lie within 100 km of the map's
  /// origin.
  void add(std::span<const Eigen::Vector3f> points_lidar, PointLabels labels,
           const std::optional<Eigen::Isometry3d>& T_map_lidar);

  /// No scan follows on these.
  void finish();

  /// Labels of the oldest scan that was not taken yet, in the order of add(); nothing while scans
  /// that vote on it are still to come.
  [[nodiscard]] std::optional<PointLabels> take();

 private:
  static constexpr std::uint32_t none = 0xFFFFFFFFU;

  struct Voxel {
    std::uint64_t key = 0;
    /// Points of the window.
    std::uint32_t points = 0;
    std::array<std::uint32_t, semantic_class_count> votes{};
    /// Number of the scan for which the rest was worked out.
    std::uint32_t decided_for = 0;
    /// A bit for each class that has most votes.
    std::uint32_t winners = 0;
    /// Of the winners', among all votes.
    float share = 0.0F;
  };
  struct VotingScan {
    PointLabels labels;
    /// As given, when `labels` are gone.
    std::vector<SemanticClass> votes_for;
    std::vector<std::uint16_t> weights;
    /// `none`: does not vote.
    std::vector<std::uint32_t> voxels;
  };

  [[nodiscard]] std::uint32_t voxel_at(std::uint64_t key);
  void remove_oldest();
  void decide_next();
  void decide(Voxel& voxel) const;

  DriveVoteConfig config_;
  tsl::robin_map<std::uint64_t, std::uint32_t, IndexHash> voxels_by_key_;
  std::vector<Voxel> voxels_;
  std::vector<std::uint32_t> free_;
  std::deque<VotingScan> window_;
  /// The first of the window that is not decided.
  std::size_t next_ = 0;
  std::uint32_t decided_scans_ = 0;
  std::deque<PointLabels> done_;
};

}  // namespace stillmap
