#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "clients/commands/planning/plan_report.hpp"
#include "clients/library/client.hpp"
#include "clients/library/tile_mirror.hpp"
#include "core/planning/path_monitor.hpp"
#include "core/planning/path_planner.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap::cli {

/// A planning request.
struct PlanTask {
  RobotProfile profile;
  /// Without one, the robot's newest pose.
  std::optional<Goal> from;
  Goal to;
  PlanningConfig config;
  /// Longest search [s].
  double time_limit_s = 2.0;
};

/// Plans on successive snapshots of a map and keeps the last plan.
class Replanner {
 public:
  explicit Replanner(PlanTask task);

  /// Updates the traversability to this map and plans. @pre the task has a start, or `robot` is one
  const TimedPlan& plan(const MapSnapshot& map, const std::optional<Goal>& robot);

  /// Plans again if the path is blocked now or the route changed. Returns whether it did.
  bool replan_if_needed(const MapSnapshot& map, const std::optional<Goal>& robot);

  [[nodiscard]] const TimedPlan& last() const { return last_; }
  [[nodiscard]] const TraversabilityView& traversability() const { return *traversability_; }

 private:
  void update(const MapSnapshot& map);
  void search(const std::optional<Goal>& robot, const std::string& cause);

  PlanTask task_;
  TraversabilityMap map_;
  std::shared_ptr<const TraversabilityView> traversability_;
  double traversability_ms_ = 0.0;
  TimedPlan last_;
  std::optional<PathMonitor> watch_;
};

/// Newest pose of the robot: the end of the published path, then the odometry.
class RobotPoseSubscription {
 public:
  /// Waits for a pose; throws ServiceTimeout when there is none in time.
  RobotPoseSubscription(Client& client, std::chrono::milliseconds timeout);

  [[nodiscard]] Goal pose() const;

 private:
  void set(const StampedPose& pose);

  mutable std::mutex mutex_;
  StampedPose newest_;
  // Last member: its callbacks end before `newest_` is destroyed.
  Subscription odometry_;
};

}  // namespace stillmap::cli
