#include "idl/interface/roles.hpp"

#include <array>

#include "idl/dds/service_identity.hpp"

namespace stillmap::dds {
namespace {

using Names = std::vector<std::string>;

// ROS 2's list of nodes and their ends, which every participant keeps.
constexpr const char* ros_discovery = "ros_discovery_info";

constexpr std::array roles{Role::server, Role::sensor, Role::planner, Role::operator_of_server};

void append(Names& names, const Names& more) {
  names.insert(names.end(), more.begin(), more.end());
}

Names all_services(const ServiceNames& services) {
  Names all = services.read_only;
  append(all, services.modifying);
  return all;
}

/// What is sent into the server.
Names inputs(const TopicNames& names) {
  Names topics{"rt/" + names.points};
  if (!names.odometry_prior.empty()) topics.push_back("rt/" + names.odometry_prior);
  return topics;
}

void allow_calling(Access& access, const Names& services) {
  for (const std::string& service : services) {
    access.publish.push_back(request_topic(service));
    access.subscribe.push_back(reply_topic(service));
  }
}

void allow_serving(Access& access, const Names& services) {
  for (const std::string& service : services) {
    access.publish.push_back(reply_topic(service));
    access.subscribe.push_back(request_topic(service));
  }
}

}  // namespace

std::string_view name(Role role) {
  switch (role) {
    case Role::server:
      return "server";
    case Role::sensor:
      return "sensor";
    case Role::planner:
      return "planner";
    case Role::operator_of_server:
      break;
  }
  return "operator";
}

std::optional<Role> role_from_name(std::string_view wanted) {
  for (const Role role : roles) {
    if (name(role) == wanted) return role;
  }
  return std::nullopt;
}

const std::string& role_names() {
  static const std::string names = [] {
    std::string text;
    for (const Role role : roles) text.append(text.empty() ? "" : ", ").append(name(role));
    return text;
  }();
  return names;
}

std::vector<std::string> published_topics(const std::string& name_space) {
  // Every field by name: one more in Topics, and this does not compile.
  const auto [odometry, tf, path, scan, static_cloud, tile_index, tiles, status, octomap,
              traversability] = Topics::in(name_space);
  return {odometry.dds_name,      tf.dds_name,           path.dds_name,
          scan.dds_name,          static_cloud.dds_name, tile_index.dds_name,
          tiles.dds_name,         status.dds_name,       octomap.dds_name,
          traversability.dds_name};
}

ServiceNames service_names(const std::string& name_space) {
  // Every field by name, as above.
  const auto [get_static_map, get_tile_versions, get_tiles, get_status, save_map, load_map, reset,
              octomap_binary, octomap_full, get_removed, restore_removed, query_occupancy,
              get_traversable_area, check_path, nearest_traversable, get_map] =
      Services::in(name_space);
  return {.read_only = {get_static_map, get_tile_versions, get_tiles, get_status, octomap_binary,
                        octomap_full, get_removed, query_occupancy, get_traversable_area,
                        check_path, nearest_traversable, get_map},
          .modifying = {save_map, load_map, reset, restore_removed}};
}

Access access_of(Role role, const TopicNames& names) {
  Access access{.publish = {ros_discovery}, .subscribe = {ros_discovery}};
  const Names outputs = published_topics(names.name_space);
  const ServiceNames services = service_names(names.name_space);
  switch (role) {
    case Role::server:
      append(access.publish, outputs);
      append(access.subscribe, inputs(names));
      allow_serving(access, all_services(services));
      break;
    case Role::sensor:
      append(access.publish, inputs(names));
      append(access.subscribe, outputs);
      allow_calling(access, {Services::in(names.name_space).get_status});
      break;
    case Role::planner:
    case Role::operator_of_server:
      append(access.subscribe, outputs);
      append(access.subscribe, inputs(names));
      allow_calling(access, role == Role::planner ? services.read_only : all_services(services));
      break;
  }
  return access;
}

}  // namespace stillmap::dds
