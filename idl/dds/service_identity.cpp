#include "idl/dds/service_identity.hpp"

#include <algorithm>
#include <cassert>

namespace stillmap::dds {

using eprosima::fastdds::dds::SampleInfo;
using eprosima::fastrtps::rtps::GUID_t;
using eprosima::fastrtps::rtps::SampleIdentity;

std::string request_topic(const std::string& service) { return "rq/" + service + "Request"; }

std::string reply_topic(const std::string& service) { return "rr/" + service + "Reply"; }

TopicQos service_qos() { return {.depth = 100, .large_messages = true}; }

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

SampleIdentity identity_of_call(const RequestId& id) {
  SampleIdentity identity;
  identity.writer_guid() = id.client;
  identity.sequence_number() =
      eprosima::fastrtps::rtps::SequenceNumber_t(static_cast<std::uint64_t>(id.number));
  return identity;
}

std::optional<RequestId> request_id(const SampleInfo& request) {
  if (!names_reply_reader(request)) return std::nullopt;
  const SampleIdentity& call = request.related_sample_identity;
  const RequestId id{.client = call.writer_guid(),
                     .number = static_cast<std::int64_t>(call.sequence_number().to64long())};
  return id.number > 0 ? std::optional(id) : std::nullopt;
}

bool has_correlation_header(const GUID_t& request_writer) {
  // A participant's GUID begins with its vendor's id.
  constexpr std::array<std::uint8_t, 2> cyclone = {0x01, 0x10};
  return std::equal(cyclone.begin(), cyclone.end(), request_writer.guidPrefix.value);
}

std::optional<CorrelationHeader> take_correlation_header(SerializedSample& request) {
  CorrelationHeader header{};
  if (request.size() < encapsulation_bytes + header.size()) return std::nullopt;
  const auto begin = request.begin() + encapsulation_bytes;
  const auto end = begin + static_cast<std::ptrdiff_t>(header.size());
  std::copy(begin, end, header.begin());
  const bool is_little_endian = (request[1] & 1U) != 0;
  if (!is_little_endian) {
    const auto middle = header.begin() + header.size() / 2;
    std::reverse(header.begin(), middle);
    std::reverse(middle, header.end());
  }
  request.erase(begin, end);
  return header;
}

void put_correlation_header(const CorrelationHeader& header, SerializedSample& reply) {
  assert(reply.size() >= encapsulation_bytes + header.size());
  std::ranges::copy(header, reply.begin() + encapsulation_bytes);
}

}  // namespace stillmap::dds
