#include "idl/dds/service_identity.hpp"

namespace stillmap {

using eprosima::fastdds::dds::SampleInfo;
using eprosima::fastrtps::rtps::GUID_t;
using eprosima::fastrtps::rtps::SampleIdentity;

std::string request_topic(const std::string& service) { return "rq/" + service + "Request"; }

std::string reply_topic(const std::string& service) { return "rr/" + service + "Reply"; }

TopicQos service_qos() { return {.depth = 100, .bulky = true}; }

SampleIdentity reply_identity(const SampleInfo& request) {
  SampleIdentity identity = request.sample_identity;
  if (names_reply_reader(request)) {
    identity.writer_guid() = request.related_sample_identity.writer_guid();
  }
  return identity;
}

bool names_reply_reader(const SampleInfo& request) {
  return request.related_sample_identity.writer_guid() != GUID_t::unknown();
}

}  // namespace stillmap
