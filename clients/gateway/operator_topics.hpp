#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "idl/dds/participant.hpp"
#include "idl/dds/serialized_sample.hpp"

namespace stillmap::gateway {

/// Publishes what operators send: where the robot is and where it is to go, as RViz2 does. One
/// thread uses it.
class OperatorTopics {
 public:
  explicit OperatorTopics(dds::Participant& participant) : participant_(participant) {}

  /// Why a client may not publish a topic (ROS 2 name) with this type; empty when it may. The
  /// topic's writer is made here, so that its readers find it before the first message.
  [[nodiscard]] std::string refusal(const std::string& topic, const std::string& type);

  /// Of a topic that was not refused. Why the bytes were not published; empty when they were.
  [[nodiscard]] std::string publish(const std::string& topic, std::span<const std::uint8_t> cdr);

 private:
  dds::Participant& participant_;
  std::map<std::string, std::unique_ptr<dds::SerializedSampleWriter>> writers_;
};

}  // namespace stillmap::gateway
