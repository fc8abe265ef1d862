#include "clients/commands/planning/replanner.hpp"

#include <chrono>
#include <utility>

#include "clients/commands/query/fetch_map.hpp"
#include "core/frames/rigid_motion.hpp"

namespace stillmap::cli {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace

Replanner::Replanner(PlanTask task) : task_(std::move(task)), map_({task_.profile}) {}

void Replanner::update(const MapSnapshot& map) {
  const Clock::time_point start = Clock::now();
  (void)map_.update(map);
  traversability_ = map_.view(task_.profile.name);
  traversability_ms_ = ms_since(start);
}

void Replanner::search(const std::optional<Goal>& robot, const std::string& cause) {
  last_ = TimedPlan{};
  last_.cause = cause;
  last_.traversability_ms = traversability_ms_;
  const Clock::time_point start = Clock::now();
  PlanningConfig config = task_.config;
  config.should_stop = [&] { return ms_since(start) > 1000.0 * task_.time_limit_s; };
  config.improved = [&](double) {
    if (!last_.first_ms) last_.first_ms = ms_since(start);
  };
  last_.plan =
      plan_path(*traversability_, task_.from ? *task_.from : robot.value(), task_.to, config);
  last_.plan_ms = ms_since(start);
  watch_.emplace(*traversability_, last_.plan);
}

const TimedPlan& Replanner::plan(const MapSnapshot& map, const std::optional<Goal>& robot) {
  update(map);
  search(robot, "");
  return last_;
}

bool Replanner::replan_if_needed(const MapSnapshot& map, const std::optional<Goal>& robot) {
  update(map);
  const std::optional<ReplanReason> cause = watch_->update(*traversability_);
  if (cause) search(robot, cause->reason);
  return cause.has_value();
}

RobotPoseSubscription::RobotPoseSubscription(Client& client, std::chrono::milliseconds timeout)
    : newest_(fetch_trajectory(client, timeout).back()),
      odometry_(
          client.subscribe_odometry([this](const OdometryUpdate& update) { set(update.pose); })) {}

void RobotPoseSubscription::set(const StampedPose& pose) {
  const std::lock_guard lock(mutex_);
  newest_ = pose;
}

Goal RobotPoseSubscription::pose() const {
  const std::lock_guard lock(mutex_);
  const Eigen::Isometry3d& T = newest_.T_map_lidar;
  return {T.translation().head<2>(), heading_rad(T), T.translation().z()};
}

}  // namespace stillmap::cli
