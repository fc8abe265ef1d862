#pragma once

#include <chrono>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "idl/dds/dds_options.hpp"
#include "idl/dds/topic_qos.hpp"

namespace stillmap::dds {

[[nodiscard]] eprosima::fastdds::dds::DataWriterQos writer_qos(const TopicQos& qos,
                                                               const DdsOptions& options);
[[nodiscard]] eprosima::fastdds::dds::DataReaderQos reader_qos(const TopicQos& qos,
                                                               const DdsOptions& options);

/// Prepares the participant for rate-limited writers.
void set_flow_controllers(const DdsOptions& options,
                          eprosima::fastdds::dds::DomainParticipantQos& qos);

/// A span of time in Fast DDS's own type.
[[nodiscard]] eprosima::fastrtps::Duration_t to_duration(std::chrono::milliseconds time);

}  // namespace stillmap::dds
