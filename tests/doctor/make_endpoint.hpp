#pragma once

#include <string>

#include "idl/dds/remote_participant.hpp"

namespace stillmap::test {

/// A reader or writer with ordinary quality of service.
inline dds::Endpoint make_endpoint(const std::string& topic, const std::string& type,
                                   bool is_writer) {
  dds::Endpoint endpoint;
  endpoint.guid = is_writer ? "writer" : "reader";
  endpoint.topic = topic;
  endpoint.type = type;
  endpoint.is_writer = is_writer;
  endpoint.qos.reliable = true;
  return endpoint;
}

}  // namespace stillmap::test
