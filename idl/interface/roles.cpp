#include "idl/interface/roles.hpp"

#include <array>

#include "idl/dds/ros_graph.hpp"
#include "idl/dds/service_topics.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::dds {
namespace {

using Names = std::vector<std::string>;

constexpr std::array roles{Role::server, Role::sensor, Role::planner, Role::operator_of_server};

void append(Names& names, const Names& more) {
  names.insert(names.end(), more.begin(), more.end());
}

/// Topics that the server reads and does not write itself.
Names inputs(const TopicNames& names) {
  Names topics;
  for (const std::string& points : names.points) topics.push_back("rt/" + points);
  if (!names.odometry_prior.empty()) topics.push_back("rt/" + names.odometry_prior);
  if (!names.imu.empty()) topics.push_back("rt/" + names.imu);
  if (!names.gnss.empty()) topics.push_back("rt/" + names.gnss);
  return topics;
}

/// Where an operator wants the robot to go, as RViz2, Nav2 and the gateway name it: for planners.
constexpr auto goal_topic = "rt/goal_pose";

/// What an operator publishes, and the server reads.
Names set_by_operators(const TopicNames& names) {
  return names.initial_pose.empty() ? Names{} : Names{"rt/" + names.initial_pose};
}

void allow_calling(Access& access, const std::string& service) {
  access.publish.push_back(request_topic(service));
  access.subscribe.push_back(reply_topic(service));
}

void allow_serving(Access& access, const std::string& service) {
  access.publish.push_back(reply_topic(service));
  access.subscribe.push_back(request_topic(service));
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
  Names names;
  for_each_topic(Topics::in(name_space),
                 [&](const auto& topic) { names.push_back(topic.dds_name); });
  return names;
}

Access access_of(Role role, const TopicNames& names) {
  // Every ROS 2 participant announces its node, and hears of the others.
  Access access{.publish = {ros_discovery_topic}, .subscribe = {ros_discovery_topic}};
  const std::string& name_space = names.name_space;
  const Names outputs = published_topics(name_space);
  const std::string tf_static = Topics::in(name_space).tf_static.dds_name;
  switch (role) {
    case Role::server:
      append(access.publish, outputs);
      append(access.subscribe, inputs(names));
      append(access.subscribe, set_by_operators(names));
      access.subscribe.push_back(tf_static);
      for_each_service([&](const auto& service) { allow_serving(access, service.in(name_space)); });
      break;
    case Role::sensor:
      append(access.publish, inputs(names));
      // The robot says where its sensors are.
      access.publish.push_back(tf_static);
      append(access.subscribe, outputs);
      allow_calling(access, services::get_status.in(name_space));
      break;
    case Role::planner:
    case Role::operator_of_server:
      append(access.subscribe, outputs);
      append(access.subscribe, inputs(names));
      append(access.subscribe, set_by_operators(names));
      access.subscribe.emplace_back(goal_topic);
      if (role == Role::operator_of_server) {
        append(access.publish, set_by_operators(names));
        access.publish.emplace_back(goal_topic);
      }
      for_each_service([&](const auto& service) {
        const bool may_call =
            role == Role::operator_of_server || service.effect == ServiceEffect::reads;
        if (may_call) allow_calling(access, service.in(name_space));
      });
      break;
  }
  return access;
}

}  // namespace stillmap::dds
