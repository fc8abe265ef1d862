#include "clients/gateway/operator_topics.hpp"

#include <algorithm>
#include <array>

#include "geometry_msgs.h"
#include "idl/dds/dds_error.hpp"
#include "initial_pose.h"

namespace stillmap::gateway {
namespace {

using eprosima::fastdds::dds::TypeSupport;

struct OperatorTopic {
  std::string name;
  TypeSupport type;
};

/// As RViz2 and Nav2 name them.
const std::vector<OperatorTopic>& operator_topics() {
  static const std::vector<OperatorTopic> topics{
      {"/initialpose", dds::type_support<geometry_msgs::msg::PoseWithCovarianceStamped>()},
      {"/goal_pose", dds::type_support<geometry_msgs::msg::PoseStamped>()}};
  return topics;
}

const OperatorTopic* find(const std::string& name) {
  const auto found = std::ranges::find(operator_topics(), name, &OperatorTopic::name);
  return found == operator_topics().end() ? nullptr : &*found;
}

/// Also without the middle part, as clients write that were made for ROS 1.
bool is_type(const std::string& written, const std::string& ros_type) {
  std::string shorter = ros_type;
  shorter.erase(shorter.find("/msg"), std::string_view("/msg").size());
  return written == ros_type || written == shorter;
}

}  // namespace

std::string OperatorTopics::refusal(const std::string& topic, const std::string& type) {
  const OperatorTopic* const known = find(topic);
  if (known == nullptr) {
    return "topic '" + topic + "' is not published for clients; /initialpose and /goal_pose are";
  }
  const std::string ros_type = dds::ros_type_name(known->type);
  if (!is_type(type, ros_type)) return topic + " carries " + ros_type + ", not " + type;
  if (writers_.contains(topic)) return {};
  try {
    writers_.emplace(topic, std::make_unique<dds::SerializedSampleWriter>(
                                participant_, "rt" + topic, known->type.get_type_name(),
                                dds::TopicQos{.depth = 1}));
  } catch (const dds::DdsError& error) {
    return error.what();
  }
  return {};
}

std::string OperatorTopics::publish(const std::string& topic, std::span<const std::uint8_t> cdr) {
  TypeSupport type = find(topic)->type;
  dds::SerializedSample bytes(cdr.begin(), cdr.end());
  void* const sample = type->createData();
  const bool is_sample = dds::from_bytes(type, bytes, sample);
  type->deleteData(sample);
  if (!is_sample) return "a message for " + topic + " is no " + dds::ros_type_name(type);
  eprosima::fastrtps::rtps::WriteParams params;
  return writers_.at(topic)->write(bytes, params) ? "" : topic + " could not be written";
}

}  // namespace stillmap::gateway
