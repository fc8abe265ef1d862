#pragma once

#include <string>

#include "idl/dds/remote_participant.hpp"

namespace stillmap::test {

/// A reader or writer with ordinary quality of service.
inline Endpoint end(const std::string& topic, const std::string& type, bool is_writer) {
  Endpoint endpoint;
  endpoint.guid = is_writer ? "writer" : "reader";
  endpoint.topic = topic;
  endpoint.type = type;
  endpoint.is_writer = is_writer;
  endpoint.qos.reliable = true;
  return endpoint;
}

}  // namespace stillmap::test
