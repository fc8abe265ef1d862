#pragma once

#include <array>
#include <cstdint>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <optional>

#include "idl/dds/serialized_sample.hpp"
#include "idl/dds/service_topics.hpp"

namespace stillmap::dds {

/// Identity that a reply carries so that rmw_fastrtps clients find their request again: the
/// request's own, its writer replaced by the client's reply reader where the request names it.
[[nodiscard]] eprosima::fastrtps::rtps::SampleIdentity reply_identity(
    const eprosima::fastdds::dds::SampleInfo& request);

/// True when a request names the reader that its reply is for.
[[nodiscard]] bool names_reply_reader(const eprosima::fastdds::dds::SampleInfo& request);

/// What all requests of one call have in common, however often the client sends it. Clients of
/// Stillmap's library name it; those of ROS 2 send a call once and do not.
struct RequestId {
  /// The client's reply reader.
  eprosima::fastrtps::rtps::GUID_t client;
  /// Above 0.
  std::int64_t number = 0;
  friend bool operator==(const RequestId&, const RequestId&) = default;
};

/// The identity that a request carries so that it names its reply reader and its call.
[[nodiscard]] eprosima::fastrtps::rtps::SampleIdentity identity_of_call(const RequestId& id);

/// Nothing when the request does not name its call.
[[nodiscard]] std::optional<RequestId> request_id(
    const eprosima::fastdds::dds::SampleInfo& request);

/// What rmw_cyclonedds puts between encapsulation and fields of a request, and looks for in the
/// reply: the client (uint64) and the request's number (int64). Kept as little-endian bytes.
using CorrelationHeader = std::array<std::uint8_t, 16>;

/// True for requests of Eclipse Cyclone DDS (RTPS vendor 01.10), which start with a
/// CorrelationHeader. Those of all other vendors are tied to their replies by sample identities.
[[nodiscard]] bool has_correlation_header(const eprosima::fastrtps::rtps::GUID_t& request_writer);

/// Takes the header out of the request. Nothing when the request is too short for one.
[[nodiscard]] std::optional<CorrelationHeader> take_correlation_header(SerializedSample& request);

/// Puts the header into a reply that has a gap for it (see to_bytes).
void put_correlation_header(const CorrelationHeader& header, SerializedSample& reply);

/// Which client sent a request, and how the reply is correlated with it.
struct ServiceCall {
  eprosima::fastrtps::rtps::GUID_t request_writer;
  /// For rmw_fastrtps and every vendor but Cyclone.
  eprosima::fastrtps::rtps::SampleIdentity reply_identity;
  bool names_reply_reader = false;
  /// For rmw_cyclonedds.
  std::optional<CorrelationHeader> header;
  /// For Stillmap's own clients.
  std::optional<RequestId> id;
};

}  // namespace stillmap::dds
