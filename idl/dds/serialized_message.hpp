#pragma once

#include <cstdint>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <string>
#include <vector>

#include "idl/dds/reader.hpp"

namespace stillmap::dds {

/// A sample as it was on the wire, with its encapsulation: neither decoded nor checked.
struct SerializedMessage {
  std::vector<std::uint8_t> bytes;
};

/// Carries samples of a generated type as their bytes.
[[nodiscard]] eprosima::fastdds::dds::TypeSupport serialized_message_type(
    const eprosima::fastdds::dds::TypeSupport& type);

/// The name that ROS 2 has for a type: "nav_msgs/msg/Odometry" of nav_msgs::msg::dds_::Odometry_.
[[nodiscard]] std::string ros_type_name(const eprosima::fastdds::dds::TypeSupport& type);

/// Reads the bytes of samples of any type. One thread takes.
class SerializedMessageReader : public UntypedReader {
 public:
  /// Throws DdsError. The participant must outlive the reader.
  SerializedMessageReader(Participant& participant, const std::string& topic,
                          const eprosima::fastdds::dds::TypeSupport& type, const TopicQos& qos)
      : UntypedReader(participant, topic, serialized_message_type(type), qos) {}

  /// The next sample that is there already; false when there is none.
  [[nodiscard]] bool take(SerializedMessage& sample, eprosima::fastdds::dds::SampleInfo& info) {
    return take_untyped(&sample, info, {}, std::chrono::milliseconds(0));
  }
};

}  // namespace stillmap::dds
