#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "core/graph/pose_graph.hpp"

namespace stillmap {

/// A measured position of a drive, as the graph takes it, and what odometry knows of its place.
struct PositionOnWay {
  PositionMeasurement measured;
  /// The antenna where odometry has it [m].
  Eigen::Vector3d point_odom = Eigen::Vector3d::Zero();
  /// Way of the lidar until there [m].
  double way_m = 0.0;
  /// Scans until there whose poses odometry could not confirm.
  std::size_t unconfirmed_scans = 0;
};

/// Of the horizontal standard deviation of a measured position [m].
[[nodiscard]] double horizontal_sigma_m(const Eigen::Matrix3d& covariance_enu);

/// Of which of these positions, in the order of their way, the heights follow each other as
/// odometry has them, whichever way it has up: those of the largest such chain. None where that is
/// less than half of them, or where they jump again and again (there and back at once is one jump).
/// A receiver's height may jump where its place does not.
[[nodiscard]] std::vector<bool> believed_heights(std::span<const PositionOnWay> positions);

/// Sorts measured positions by what they say of the way between them: those that follow each other
/// as far apart as odometry has them are a chain. A receiver that holds its last position, or sees
/// reflections, says of the way what is not so, or what nothing before it goes on to; most of what
/// it says does not. One goes on where the newest chain is that it can: what is off by the same
/// since some moment stays a chain of its own, however long the way since then. But a larger chain
/// has it where its newest positions, no long way before, foretell it: a reflection that sets in at
/// once and fades takes nothing along. The largest chain is believed; where heights of it are not,
/// they are unknown, and lie where the believed ones have them, or the middle one of all.
class PositionChains {
 public:
  /// Of one chain, positions count once on so much way, and once on so many of their standard
  /// deviations.
  PositionChains(double spacing_m, double spacing_sigmas)
      : spacing_m_(spacing_m), spacing_sigmas_(spacing_sigmas) {}

  /// Positions come in the order of their way.
  void add(const PositionOnWay& position);
  void clear();

  /// Those of the largest chain. The newest one may still be replaced by a better one, until this
  /// is called.
  [[nodiscard]] std::span<const PositionMeasurement> believed();
  /// How many they are.
  [[nodiscard]] std::size_t believed_count() const {
    return chains_.empty() ? 0 : chains_.front().positions.size();
  }
  /// Positions of other chains.
  [[nodiscard]] std::size_t disbelieved() const;

 private:
  struct Chain {
    std::vector<PositionOnWay> positions;

    [[nodiscard]] const PositionOnWay& last() const { return positions.back(); }
  };
  /// The chain that the position goes on; the end of them where it begins one.
  [[nodiscard]] std::vector<Chain>::iterator chain_before(const PositionOnWay& position);
  void extend(Chain& chain, const PositionOnWay& position) const;

  double spacing_m_;
  double spacing_sigmas_;
  std::vector<Chain> chains_;
  /// Of chains that were left off.
  std::size_t dropped_ = 0;
  /// Positions of the largest chain that are in use.
  std::size_t used_ = 0;
  /// Those of the last call of believed().
  std::vector<PositionMeasurement> believed_;
};

}  // namespace stillmap
