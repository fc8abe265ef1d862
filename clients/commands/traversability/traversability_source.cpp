#include "clients/commands/traversability/traversability_source.hpp"

#include <stdexcept>
#include <utility>

#include "clients/commands/query/fetch_map.hpp"
#include "config/loaders/config_error.hpp"
#include "config/loaders/robot_profile.hpp"
#include "core/map/storage/map_file_copy.hpp"

namespace stillmap::cli {
namespace {

class FileSource final : public TraversabilitySource {
 public:
  explicit FileSource(const TraversabilitySourceArguments& arguments)
      : traversability_({load_robot_profile(arguments.profile)}),
        map_(read_map_file(arguments.map_file)) {
    update_stats_ = traversability_.update(map_.view);
  }

  [[nodiscard]] RobotProfile robot() const override { return traversability_.profiles().front(); }
  [[nodiscard]] TraversabilityAnswer traversability(TraversabilityQuery query) override {
    return query_traversability(view(), query);
  }
  [[nodiscard]] PathCheck check(PathQuery query) override { return check_path(view(), query); }
  [[nodiscard]] NearestTraversable nearest(const Eigen::Vector2d& position_map,
                                           double max_distance_m) override {
    return nearest_traversable(view(), position_map, max_distance_m);
  }
  [[nodiscard]] Trajectory trajectory() override { return map_.trajectory.to_vector(); }
  [[nodiscard]] std::optional<TraversabilityUpdate> update_stats() const override {
    return update_stats_;
  }

 private:
  [[nodiscard]] const TraversabilityView& view() const {
    return *traversability_.view(robot().name);
  }

  TraversabilityMap traversability_;
  SavedMap map_;
  TraversabilityUpdate update_stats_;
};

class ServerSource final : public TraversabilitySource {
 public:
  explicit ServerSource(const TraversabilitySourceArguments& arguments)
      : profile_(arguments.profile),
        timeout_(arguments.client.timeout()),
        client_(connect(arguments.client)) {}

  [[nodiscard]] RobotProfile robot() const override {
    try {
      return load_robot_profile(profile_);
    } catch (const ConfigError&) {
      RobotProfile named;
      named.name = profile_;
      return named;
    }
  }
  [[nodiscard]] TraversabilityAnswer traversability(TraversabilityQuery query) override {
    query.profile = profile_;
    return client_.get_traversable_area(query);
  }
  [[nodiscard]] PathCheck check(PathQuery query) override {
    query.profile = profile_;
    return client_.check_path(query);
  }
  [[nodiscard]] NearestTraversable nearest(const Eigen::Vector2d& position_map,
                                           double max_distance_m) override {
    return client_.nearest_traversable(profile_, position_map, max_distance_m);
  }
  [[nodiscard]] Trajectory trajectory() override { return fetch_trajectory(client_, timeout_); }
  [[nodiscard]] std::optional<TraversabilityUpdate> update_stats() const override {
    return std::nullopt;
  }

 private:
  std::string profile_;
  std::chrono::milliseconds timeout_;
  Client client_;
};

}  // namespace

void add_traversability_source_options(CommandHandle command,
                                       TraversabilitySourceArguments& arguments) {
  command.option("MAPFILE,--map", arguments.map_file,
                 "Map file (map.stillmap of 'stillmap map'); without it, a server is asked");
  command
      .option("--profile", arguments.profile,
              "The robot: car, delivery_robot, tracked; with a map file also a file like "
              "config/robots/car.yaml")
      .with_default();
  add_client_options(command, arguments.client);
}

std::unique_ptr<TraversabilitySource> open_traversability_source(
    const TraversabilitySourceArguments& arguments) {
  if (arguments.map_file.empty()) return std::make_unique<ServerSource>(arguments);
  return std::make_unique<FileSource>(arguments);
}

Region region_of(const RegionArguments& region, TraversabilitySource& source) {
  Eigen::Vector2d robot_map = Eigen::Vector2d::Zero();
  if (region.around_robot_m > 0.0) {
    const Trajectory trajectory = source.trajectory();
    if (trajectory.empty())
      throw std::invalid_argument("--around-robot: the map has no trajectory");
    robot_map = trajectory.back().T_map_lidar.translation().head<2>();
  }
  return region_at(region, robot_map);
}

void require_answer(TraversabilityStatus status, const std::string& reason) {
  if (status == TraversabilityStatus::ok || status == TraversabilityStatus::not_found) return;
  throw std::invalid_argument(reason);
}

}  // namespace stillmap::cli
