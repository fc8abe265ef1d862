#pragma once

#include <array>
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

}  // namespace stillmap::dds
