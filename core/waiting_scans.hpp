#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/odometry/odometry_state.hpp"

namespace stillmap {

/// Scans that wait until it is known where they are (MapEntry::waits): as many along the way as
/// there is room for.
template <typename Scan>
class WaitingScans {
 public:
  /// Of all: some 150 MB.
  static constexpr std::size_t max_points = 6'000'000;

  /// The next one. Left out where the lidar has hardly moved since the last [map frame, m].
  void add(Scan scan, const Eigen::Vector3d& position_map, std::size_t points) {
    if (!waiting_.empty() && is_near(waiting_.back(), position_map)) return;
    waiting_.push_back({std::move(scan), position_map, points});
    points_ += points;
    while (points_ > max_points && waiting_.size() > 1) thin_out();
  }

  /// Those that enter the map before the scan of this entry. Unless they go on waiting, none waits
  /// afterwards.
  [[nodiscard]] std::vector<Scan> decided_by(MapEntry entry) {
    std::vector<Scan> entering;
    if (entry == MapEntry::waits || entry == MapEntry::stays_out) return entering;
    if (entry == MapEntry::enters_with_waiting)
      for (Waiting& waiting : waiting_) entering.push_back(std::move(waiting.scan));
    clear();
    return entering;
  }

  void clear() {
    waiting_.clear();
    points_ = 0;
    spacing_m_ = first_spacing_m;
  }
  [[nodiscard]] bool empty() const { return waiting_.empty(); }
  [[nodiscard]] std::size_t size() const { return waiting_.size(); }

  template <typename Change>
  void for_each(Change change) {
    for (Waiting& waiting : waiting_) change(waiting.scan);
  }

 private:
  static constexpr double first_spacing_m = 0.5;

  struct Waiting {
    Scan scan;
    Eigen::Vector3d position_map;
    std::size_t points = 0;
  };

  [[nodiscard]] bool is_near(const Waiting& last, const Eigen::Vector3d& position_map) const {
    return (position_map - last.position_map).norm() < spacing_m_;
  }
  void thin_out() {
    spacing_m_ *= 2.0;
    std::vector<Waiting> apart;
    points_ = 0;
    for (Waiting& waiting : waiting_) {
      if (!apart.empty() && is_near(apart.back(), waiting.position_map)) continue;
      points_ += waiting.points;
      apart.push_back(std::move(waiting));
    }
    waiting_ = std::move(apart);
  }

  std::vector<Waiting> waiting_;
  std::size_t points_ = 0;
  double spacing_m_ = first_spacing_m;
};

}  // namespace stillmap
