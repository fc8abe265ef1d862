#pragma once

#include <Eigen/Core>

#include "core/odometry/odometry_state.hpp"

namespace stillmap {

/// How well scans have lately fitted the local map: what a fit is judged by.
class FitStatistics {
 public:
  /// A scan that was registered.
  void add(const OdometryResult& result);

  /// Whether enough fits are known to judge by.
  [[nodiscard]] bool are_known() const;

  /// Whether a scan lies as well on the local map as scans have lately: no other start is tried.
  [[nodiscard]] bool fits(const OdometryResult& result) const;
  /// Whether it lies so much worse that the lidar may be somewhere else.
  [[nodiscard]] bool fits_poorly(const OdometryResult& result) const;
  /// Whether a pose can be believed; all can before enough fits are known.
  [[nodiscard]] bool believes(const OdometryResult& result) const;
  /// The same, where registration came to the place that motion foretold (see is_foretold).
  [[nodiscard]] bool believes_foretold(const OdometryResult& result) const;
  /// The same, where no prediction told the place: by what stands up in it alone, and more of that.
  [[nodiscard]] bool believes_relocalized(const OdometryResult& result) const;
  /// Whether enough of all its features fits to tell a place by, where part of it lies in unknown
  /// space.
  [[nodiscard]] bool confirms(const OdometryResult& result) const;
  /// Whether the points have lately, with this pose, wanted to go the same level way: one scan may
  /// be pulled by traffic, but features that slide are contradicted again and again.
  [[nodiscard]] bool is_contradicted_by_points(const OdometryResult& result) const;
  /// Where what comes lies in the map as it was before.
  void forget_point_deviation();

 private:
  [[nodiscard]] Eigen::Vector2d mean_point_deviation_with(const OdometryResult& result) const;

  /// Running means of OdometryResult::fit and upright_fit.
  double mean_fit_ = 0.0;
  double mean_upright_fit_ = 0.0;
  /// Of OdometryResult::point_deviation_m, along the map's x and y.
  Eigen::Vector2d mean_point_deviation_m_ = Eigen::Vector2d::Zero();
  int count_ = 0;
};

}  // namespace stillmap
