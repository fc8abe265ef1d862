#pragma once

#include <chrono>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "idl/dds/dds_options.hpp"

namespace stillmap::dds {

/// Quality of service of a reader or writer, as far as Stillmap needs it.
struct TopicQos {
  bool reliable = true;
  /// A late joiner gets the samples that the writer still has.
  bool transient_local = false;
  /// Samples kept, per key on a keyed topic.
  int depth = 10;
  /// Keep every sample, up to `depth` of them: a full writer waits, a full reliable reader makes
  /// the writer wait.
  bool keep_all = false;
  /// Keys a keyed topic may have.
  int max_keys = 1;
  /// Large samples: they keep to DdsOptions::large_message_bytes_per_s, and a write does not wait
  /// for that.
  bool large_messages = false;
  /// Longest wait of one write for room in a keep_all history.
  std::chrono::milliseconds max_blocking{100};
};

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
