#pragma once

#include <memory>
#include <string>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/query/region_arguments.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_map.hpp"
#include "core/traversability/traversability_query.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap::cli {

/// Source of the traversability that a command line names.
struct TraversabilitySourceArguments {
  /// Empty: a server.
  std::string map_file;
  std::string profile = "car";
  ClientArguments client;
};

/// Adds MAPFILE, --profile and the options of a client.
void add_traversability_source_options(CommandHandle command,
                                       TraversabilitySourceArguments& arguments);

/// Traversability of a server, or of a map file, for which it is computed here.
class TraversabilitySource {
 public:
  virtual ~TraversabilitySource() = default;

  /// The robot. With a server only its name is known when this machine has no profile of that name.
  [[nodiscard]] virtual RobotProfile robot() const = 0;
  /// As in core and Client: a refusal is part of the result. `profile` is filled in.
  [[nodiscard]] virtual TraversabilityAnswer traversability(TraversabilityQuery query) = 0;
  [[nodiscard]] virtual PathCheck check(PathQuery query) = 0;
  [[nodiscard]] virtual NearestTraversable nearest(const Eigen::Vector2d& position_map,
                                                   double max_distance_m) = 0;
  /// Poses of the lidar. Throws as fetch_trajectory does when a server has none.
  [[nodiscard]] virtual Trajectory trajectory() = 0;
  /// Cost of computing the whole map; nothing for a server, which keeps it up to date.
  [[nodiscard]] virtual std::optional<TraversabilityUpdate> update_stats() const = 0;
};

/// Opens the map file or finds the server. Throws ConfigError, DatasetError or MapFileError for a
/// robot or a file, ServiceTimeout without a server.
[[nodiscard]] std::unique_ptr<TraversabilitySource> open_traversability_source(
    const TraversabilitySourceArguments& arguments);

/// The region that a command line names, round the newest pose where it names the robot. Throws as
/// check_region does.
[[nodiscard]] Region region_of(const RegionArguments& region, TraversabilitySource& source);

/// Throws std::invalid_argument with the reason unless the status is ok or `not_found`.
void require_answer(TraversabilityStatus status, const std::string& reason);

}  // namespace stillmap::cli
