#include "clients/commands/planning/replanner.hpp"

#include <chrono>
#include <utility>

#include "clients/commands/query/fetch_map.hpp"

namespace stillmap {
namespace {

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace

PlanRun::PlanRun(PlanTask task) : task_(std::move(task)), map_({task_.profile}) {}

void PlanRun::update(const MapView& map) {
  const Clock::time_point start = Clock::now();
  (void)map_.update(map);
  area_ = map_.view(task_.profile.name);
  area_ms_ = ms_since(start);
}

void PlanRun::search(const std::optional<PlanPlace>& robot, const std::string& cause) {
  last_ = TimedPlan{};
  last_.cause = cause;
  last_.area_ms = area_ms_;
  const Clock::time_point start = Clock::now();
  PlanningConfig config = task_.config;
  config.should_stop = [&] { return ms_since(start) > 1000.0 * task_.time_limit_s; };
  config.improved = [&](double) {
    if (!last_.first_ms) last_.first_ms = ms_since(start);
  };
  last_.plan = plan_path(*area_, task_.from ? *task_.from : robot.value(), task_.to, config);
  last_.plan_ms = ms_since(start);
  watch_.emplace(*area_, last_.plan);
}

const TimedPlan& PlanRun::plan(const MapView& map, const std::optional<PlanPlace>& robot) {
  update(map);
  search(robot, "");
  return last_;
}

bool PlanRun::follow(const MapView& map, const std::optional<PlanPlace>& robot) {
  update(map);
  const std::optional<ReplanCause> cause = watch_->look_at(*area_);
  if (cause) search(robot, cause->reason);
  return cause.has_value();
}

RobotPlace::RobotPlace(Client& client, std::chrono::milliseconds timeout)
    : newest_(newest_path(client, timeout).back()),
      odometry_(
          client.subscribe_odometry([this](const OdometryUpdate& update) { set(update.pose); })) {}

void RobotPlace::set(const StampedPose& pose) {
  const std::lock_guard lock(mutex_);
  newest_ = pose;
}

PlanPlace RobotPlace::now() const {
  const std::lock_guard lock(mutex_);
  const Eigen::Isometry3d& T = newest_.T_map_lidar;
  return {T.translation().head<2>(), std::atan2(T.linear()(1, 0), T.linear()(0, 0))};
}

}  // namespace stillmap
