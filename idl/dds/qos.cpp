#include "idl/dds/qos.hpp"

#include <algorithm>
#include <fastdds/rtps/flowcontrol/FlowControllerDescriptor.hpp>
#include <memory>

namespace stillmap::dds {
namespace {

using namespace eprosima::fastdds::dds;

constexpr const char* rate_limiter = "stillmap_large_messages";
// Short, so that what is small gets through between two portions.
constexpr std::uint32_t portions_per_s = 20;

std::chrono::milliseconds milliseconds(std::uint32_t count) {
  return std::chrono::milliseconds(count);
}

// What readers and writers share. Payloads may grow (clouds of any size); data-sharing cannot work
// with unbounded types.
template <typename Qos>
void set_common(Qos& out, const TopicQos& qos) {
  out.reliability().kind = qos.reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
  out.reliability().max_blocking_time = to_duration(qos.max_blocking);
  out.durability().kind =
      qos.transient_local ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
  out.history().kind = qos.keep_all ? KEEP_ALL_HISTORY_QOS : KEEP_LAST_HISTORY_QOS;
  out.history().depth = qos.depth;
  out.endpoint().history_memory_policy =
      eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  out.data_sharing().off();
  auto& limits = out.resource_limits();
  limits.allocated_samples = std::min(qos.depth, 4);
  if (qos.keep_all) {
    limits.max_samples = qos.depth;
    limits.max_instances = 1;
    limits.max_samples_per_instance = qos.depth;
  } else {
    // 0 is "no limit": the history's depth is the limit.
    limits.max_samples = 0;
    limits.max_instances = qos.max_keys;
    limits.max_samples_per_instance = 0;
  }
}

}  // namespace

eprosima::fastrtps::Duration_t to_duration(std::chrono::milliseconds time) {
  return eprosima::fastrtps::Duration_t(std::chrono::duration<double>(time).count());
}

DataWriterQos writer_qos(const TopicQos& qos, const DdsOptions& options) {
  DataWriterQos out;
  set_common(out, qos);
  // The default of 3 s makes the repair of one lost fragment of a large sample take seconds.
  auto& times = out.reliable_writer_qos().times;
  times.heartbeatPeriod = to_duration(milliseconds(options.heartbeat_ms));
  times.nackResponseDelay = to_duration(milliseconds(options.repair_delay_ms));
  // Asynchronous writers lose KEEP_LAST samples: those that newer ones replace before they are
  // sent. Of large messages, on a slow network, that is wanted.
  out.publish_mode().kind = SYNCHRONOUS_PUBLISH_MODE;
  if (qos.large_messages && options.large_message_bytes_per_s > 0) {
    out.publish_mode().kind = ASYNCHRONOUS_PUBLISH_MODE;
    out.publish_mode().flow_controller_name = rate_limiter;
  }
  // Their sizes differ: with preallocation, each slot would keep the memory of its largest sample.
  if (qos.max_keys > 1 || qos.large_messages) {
    out.endpoint().history_memory_policy = eprosima::fastrtps::rtps::DYNAMIC_RESERVE_MEMORY_MODE;
  }
  // Readers filter for themselves: Fast DDS's writers crash when a reader with a filter goes while
  // they write (its issue 4878).
  out.writer_resource_limits().reader_filters_allocation.initial = 0;
  out.writer_resource_limits().reader_filters_allocation.maximum = 0;
  // Readers keep instances that are unregistered here.
  out.writer_data_lifecycle().autodispose_unregistered_instances = false;
  return out;
}

DataReaderQos reader_qos(const TopicQos& qos, const DdsOptions& options) {
  DataReaderQos out;
  set_common(out, qos);
  out.reliable_reader_qos().times.heartbeatResponseDelay =
      to_duration(milliseconds(options.repair_delay_ms));
  return out;
}

void set_flow_controllers(const DdsOptions& options, DomainParticipantQos& qos) {
  if (options.large_message_bytes_per_s == 0) return;
  using eprosima::fastdds::rtps::FlowControllerDescriptor;
  const auto pace = std::make_shared<FlowControllerDescriptor>();
  pace->name = rate_limiter;
  pace->max_bytes_per_period =
      static_cast<std::int32_t>(options.large_message_bytes_per_s / portions_per_s);
  pace->period_ms = 1000 / portions_per_s;
  qos.flow_controllers().push_back(pace);
}

}  // namespace stillmap::dds
