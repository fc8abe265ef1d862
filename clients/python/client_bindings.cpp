#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <numbers>
#include <optional>
#include <stdexcept>

#include "clients/library/client.hpp"
#include "clients/python/bindings.hpp"
#include "clients/python/map.hpp"
#include "clients/python/traversability.hpp"
#include "config/loaders/dds_profile.hpp"
#include "idl/dds/ros_domain.hpp"

namespace stillmap::python {
namespace {

std::chrono::milliseconds duration_of(double seconds) {
  // A year and more is for ever, which clocks cannot count to.
  constexpr double longest_s = 4e7;
  if (!(seconds >= 0.0)) throw std::invalid_argument("timeout_s must be 0 or more");
  seconds = std::min(seconds, longest_s);
  return std::chrono::milliseconds(static_cast<std::int64_t>(1000.0 * seconds));
}

/// Calls `wait(so long, waited before)` until it is true or the time is up; in between Ctrl-C ends
/// it. Waits are twice as long each time, up to `max_slice`; the last one ends with the time.
template <typename Wait>
bool wait_for(double timeout_s, std::chrono::milliseconds max_slice, Wait wait) {
  std::chrono::milliseconds slice(std::min(max_slice, std::chrono::milliseconds(500)));
  const std::chrono::milliseconds timeout = duration_of(timeout_s);
  const auto end = std::chrono::steady_clock::now() + timeout;
  for (;;) {
    const auto left = std::max(std::chrono::milliseconds(0),
                               std::chrono::duration_cast<std::chrono::milliseconds>(
                                   end - std::chrono::steady_clock::now()));
    if (wait(std::min(left, slice), timeout - left)) return true;
    if (left <= slice) return false;
    slice = std::min(2 * slice, max_slice);
    const py::gil_scoped_acquire held;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  }
}

std::unique_ptr<Client> connect(std::optional<std::uint32_t> domain, const std::string& server,
                                const std::string& profile,
                                const std::vector<std::string>& interfaces,
                                const std::vector<std::string>& peers,
                                const std::string& discovery_server,
                                const std::optional<std::filesystem::path>& security,
                                double timeout_s) {
  const py::gil_scoped_release released;
  const DdsNetworkConfig network{.profile = profile,
                                 .shared_memory = {},
                                 .interfaces = interfaces,
                                 .peers = peers,
                                 .discovery_server = discovery_server,
                                 .socket_buffer_bytes = 0};
  ClientOptions options{.dds = dds_options(network, DdsRole::client),
                        .server_name = server,
                        .request_timeout = duration_of(timeout_s)};
  options.dds.domain_id = domain ? *domain : dds::ros_domain_id();
  options.dds.security = security.value_or("");
  auto client = std::make_unique<Client>(options);
  std::optional<ServiceTimeout> fault;
  // An answer over a slow link takes long.
  constexpr std::chrono::seconds max_slice(10);
  const auto answers = [&](std::chrono::milliseconds slice, std::chrono::milliseconds waited) {
    try {
      client->wait_for_server(slice, waited);
      return true;
    } catch (const ServiceTimeout& timeout) {
      fault = timeout;
      return false;
    }
  };
  if (!wait_for(timeout_s, max_slice, answers)) throw *fault;
  return client;
}

py::dict status(Client& client) {
  dds::ServerStatus now;
  {
    const py::gil_scoped_release released;
    now = client.status();
  }
  py::dict fields, counters;
  for (const dds::NamedCounter& counter : now.counters) {
    const std::string key =
        counter.detail.empty() ? counter.name : counter.name + "/" + counter.detail;
    counters[py::str(key)] = counter.value;
  }
  fields["stamp_ns"] = now.stamp_ns;
  fields["software_version"] = now.software_version;
  fields["health"] = std::string(name(now.health));
  fields["reason"] = now.reason;
  fields["label_source"] = now.label_source;
  fields["sensor"] = now.sensor;
  fields["received_hz"] = now.received_hz;
  fields["mapped_hz"] = now.mapped_hz;
  fields["map_id"] = now.map_id;
  fields["map_version"] = now.map_version;
  fields["tile_count"] = now.tile_count;
  fields["voxel_count"] = now.voxel_count;
  fields["counters"] = counters;
  return fields;
}

py::object query_server(Client& client, const Region& region,
                        const std::vector<std::string>& classes, double resolution_m) {
  MapQuery query;
  query.region = region;
  query.classes = classes_from(classes);
  query.resolution_m = resolution_m;
  MapQueryResult result;
  {
    const py::gil_scoped_release released;
    result = client.get_whole_static_map(query);
  }
  return query_answer(std::move(result));
}

/// The newest message of a subscription. Throws ServiceTimeout with `fault`.
template <typename Message, typename Subscribe>
Message newest_of(Subscribe subscribe, double timeout_s, const char* fault) {
  std::mutex mutex;
  std::condition_variable arrived;
  std::optional<Message> newest;
  const Subscription subscription = subscribe([&](const Message& message) {
    const std::lock_guard lock(mutex);
    newest = message;
    arrived.notify_one();
  });
  constexpr std::chrono::milliseconds max_slice(200);
  const auto has_come = [&](std::chrono::milliseconds slice, std::chrono::milliseconds) {
    std::unique_lock lock(mutex);
    return arrived.wait_for(lock, slice, [&] { return newest.has_value(); });
  };
  if (!wait_for(timeout_s, max_slice, has_come)) throw ServiceTimeout(fault);
  const std::lock_guard lock(mutex);
  return *newest;
}

Trajectory path_of(Client& client, double timeout_s) {
  return newest_of<Trajectory>([&](auto arrived) { return client.subscribe_path(arrived); },
                               timeout_s, "the server has no pose yet: it has mapped no scan");
}

Map whole_map(Client& client) {
  return {.view = std::make_shared<const MapSnapshot>(client.get_map()),
          .trajectory = {},
          .metadata = {},
          .read_evidence = {}};
}

py::object grid(Client& client, const Region& region, const std::string& robot) {
  TraversabilityAnswer answer;
  {
    const py::gil_scoped_release released;
    answer = client.get_traversable_area({.profile = robot, .region = region});
  }
  return grid_of(answer);
}

py::object check(Client& client, const InArray<double>& positions_map,
                 const std::optional<InArray<double>>& headings_rad, const std::string& robot) {
  PathQuery query = path_query_from(positions_map, headings_rad);
  query.profile = robot;
  PathCheck result;
  {
    const py::gil_scoped_release released;
    result = client.check_path(query);
  }
  return check_of(result);
}

py::object nearest(Client& client, double x_m, double y_m, const std::string& robot,
                   double max_distance_m) {
  NearestTraversable result;
  {
    const py::gil_scoped_release released;
    result = client.nearest_traversable(robot, {x_m, y_m}, max_distance_m);
  }
  return nearest_of(result);
}

py::object removed(Client& client, const Region& region, std::uint32_t max_voxels) {
  RemovedVoxels result;
  {
    const py::gil_scoped_release released;
    result = client.get_removed(region, max_voxels);
  }
  py::object removed = removed_arrays(result.voxels);
  removed.attr("total") = result.total;
  removed.attr("incomplete") = result.incomplete;
  return removed;
}

py::object submaps(Client& client, double timeout_s) {
  SubmapsOfMap now;
  {
    const py::gil_scoped_release released;
    now = newest_of<SubmapsOfMap>([&](auto arrived) { return client.subscribe_submaps(arrived); },
                                  timeout_s,
                                  "the server tells no submaps: it closes no loops "
                                  "(map.close_loops: false), or is older");
  }
  Trajectory poses;
  std::vector<double> ways_m, jumps_m;
  for (const SubmapList::Entry& entry : now.list.submaps) {
    poses.push_back({entry.stamp_ns, entry.T_map_submap});
    ways_m.push_back(entry.way_m);
  }
  std::vector<std::array<std::int64_t, 2>> loops;
  for (const SubmapList::Loop& loop : now.list.loops) {
    loops.push_back({static_cast<std::int64_t>(loop.from), static_cast<std::int64_t>(loop.to)});
    jumps_m.push_back(loop.jump_m);
  }
  py::dict fields;
  fields["map_id"] = now.map_id;
  fields["graph_revision"] = now.list.graph_revision;
  fields["trajectory"] = trajectory_of(poses);
  fields["way_m"] = array_of<double>(std::move(ways_m));
  fields["loops"] = array_of<std::int64_t>(std::move(loops), 2);
  fields["jump_m"] = array_of<double>(std::move(jumps_m));
  return namespace_of(fields);
}

py::object localize(Client& client, const std::optional<std::array<double, 3>>& near,
                    double radius_m, double max_turn_rad, bool apply) {
  LocalizationQuestion question{.guess = std::nullopt, .apply = apply};
  if (near) {
    const auto& [x_m, y_m, heading_rad] = *near;
    question.guess =
        PlaceGuess{.T_map_base = Eigen::Translation3d(x_m, y_m, 0.0) *
                                 Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ()),
                   .radius_m = radius_m,
                   .max_turn_rad = max_turn_rad};
  }
  LocalizationAnswer answer;
  {
    const py::gil_scoped_release released;
    answer = client.localize(question);
  }
  const bool is_found = answer.outcome == LocalizationStatus::found;
  py::dict fields;
  fields["outcome"] = std::string(name(answer.outcome));
  fields["T_map_base"] = is_found ? py::object(array_from(answer.T_map_base)) : py::none();
  fields["stamp_ns"] = answer.stamp_ns;
  fields["score"] = answer.score;
  fields["runner_up_score"] = answer.runner_up_score;
  fields["applied"] = answer.applied;
  return namespace_of(fields);
}

void bind_place_requests(py::class_<Client>& client) {
  client
      .def("submaps", &submaps, py::arg("timeout_s") = 5.0,
           "Where the submaps of the running map lie, and the loops that join them: map_id, "
           "graph_revision (how often loop closing has moved them), trajectory (their poses, a "
           "Trajectory), way_m (n,), loops (m, 2) indices of submaps, jump_m (m,). Raises "
           "ServiceTimeout where the server closes no loops.")
      .def("localize", &localize, py::arg("near") = py::none(), py::arg("radius_m") = 20.0,
           py::arg("max_turn_rad") = std::numbers::pi, py::arg("apply") = false,
           "Where the server's last scan is in its map: outcome ('found', 'ambiguous', "
           "'not_found', 'no_evidence'), T_map_base (4, 4; None unless found), stamp_ns, score, "
           "runner_up_score, applied. near: x, y [m] and heading [rad] in the map frame; None: "
           "anywhere. radius_m, max_turn_rad: how far it is from there at most, and how far it is "
           "turned; above 0, else ValueError. apply: the server goes on there once the next scans "
           "confirm it.");
}

void bind_map_requests(py::class_<Client>& client) {
  client
      .def("query", &query_server, py::arg("region"),
           py::arg("classes") = std::vector<std::string>{}, py::arg("resolution_m") = 0.0,
           "Voxels of a region of the static map, all of one version: a QueryAnswer. classes: "
           "names, none are all. resolution_m: 0 is the map's own.")
      .def("map", &whole_map, py::call_guard<py::gil_scoped_release>(),
           "The whole static map as it is now, for arrays, traversability and plans: a Map.")
      .def("removed", &removed, py::arg("region") = BoxRegion{}, py::arg("max_voxels") = 300'000,
           "What the server keeps out of its map, and why: as Map.removed().")
      .def(
          "trajectory",
          [](Client& asked, double timeout_s) {
            Trajectory path;
            {
              const py::gil_scoped_release released;
              path = path_of(asked, timeout_s);
            }
            return trajectory_of(path);
          },
          py::arg("timeout_s") = 5.0,
          "The path since the map began, as last published: publish.path_period_s (1 s) ago "
          "at most.")
      .def(
          "save_map",
          [](Client& asked, const std::string& file, bool overwrite) {
            return asked.save_map(file, overwrite);
          },
          py::arg("file") = "", py::arg("overwrite") = false,
          py::call_guard<py::gil_scoped_release>(),
          "Has the server save its map; returns the file's name on the server's machine.");
}

}  // namespace

void bind_client(py::module_& module) {
  py::class_<Client> client(module, "Client",
                            "A client of one stillmap-server. Calls may come from any thread and "
                            "wait for the answer without the interpreter's lock; they raise "
                            "ServiceTimeout without one, ServiceError for a refusal.");
  client
      .def(py::init(&connect), py::arg("domain") = py::none(), py::arg("server") = "stillmap",
           py::arg("profile") = "lan", py::arg("interfaces") = std::vector<std::string>{},
           py::arg("peers") = std::vector<std::string>{}, py::arg("discovery_server") = "",
           py::arg("security") = py::none(), py::arg("timeout_s") = 5.0,
           "Joins the DDS domain (else that of ROS_DOMAIN_ID, else 0) and waits for the server. "
           "server: first part of its topic names. "
           "profile: kind of network (host, lan, wifi, wan, no_multicast, or a file). security: "
           "folder of our identity in a secured domain. Raises ConfigError, DdsError, "
           "ServiceTimeout.")
      .def("status", &status, "State of the server: health, rates, counters, size of the map.")
      .def("grid", &grid, py::arg("region") = BoxRegion{}, py::arg("robot") = "car",
           "Where a robot of the server's can go in a region: as Traversability.grid().")
      .def("nearest", &nearest, py::arg("x_m"), py::arg("y_m"), py::arg("robot") = "car",
           py::arg("max_distance_m") = 100.0, "As Traversability.nearest().")
      .def("check_path", &check, py::arg("positions_map"), py::arg("headings_rad") = py::none(),
           py::arg("robot") = "car", "As Traversability.check_path().");
  bind_map_requests(client);
  bind_place_requests(client);
}

}  // namespace stillmap::python
