#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>

#include "idl/dds/serialized_sample.hpp"
#include "idl/dds/service_faults.hpp"
#include "idl/dds/service_identity.hpp"

namespace stillmap::dds {

/// Who asked, and how the reply is to be tied to the request.
struct ServiceCall {
  eprosima::fastrtps::rtps::GUID_t request_writer;
  /// For rmw_fastrtps and every vendor but Cyclone.
  eprosima::fastrtps::rtps::SampleIdentity reply_identity;
  bool names_reply_reader = false;
  /// For rmw_cyclonedds.
  std::optional<CorrelationHeader> header;
  /// False when the bytes are no request of the service's type.
  bool is_readable = false;
};

/// The server's end of one ROS 2 service, for clients of rmw_fastrtps and of rmw_cyclonedds. One
/// thread uses it.
class UntypedServiceServer {
 public:
  using TypeSupport = eprosima::fastdds::dds::TypeSupport;

  /// Throws DdsError when the topics cannot be made.
  UntypedServiceServer(Participant& participant, const std::string& service,
                       TypeSupport request_type, TypeSupport reply_type);

  /// Waits for the next request and reads it into `request`, an object of the request's type;
  /// meanwhile sends replies whose readers have been found. Nothing after `timeout`, on a stop, or
  /// when a request came that cannot even be refused.
  [[nodiscard]] std::optional<ServiceCall> take(void* request, const std::stop_token& stop,
                                                std::chrono::milliseconds timeout);

  /// Sends the reply as soon as its reader is found; a reader that is not found in time gets none.
  void send_reply(const ServiceCall& call, const void* reply);

 private:
  using Clock = std::chrono::steady_clock;

  struct WaitingReply {
    ServiceCall call;
    SerializedSample bytes;
    Clock::time_point deadline;
  };

  [[nodiscard]] std::optional<ServiceCall> read(SerializedSample& bytes,
                                                const eprosima::fastdds::dds::SampleInfo& info,
                                                void* request);
  void remember(const eprosima::fastrtps::rtps::GUID_t& request_writer);
  [[nodiscard]] bool reaches_client(const ServiceCall& call) const;
  [[nodiscard]] bool may_reach_client(const ServiceCall& call) const;
  void send_waiting();
  void send(const WaitingReply& reply);

  std::string service_;
  ServiceFaults& faults_;
  TypeSupport request_type_;
  TypeSupport reply_type_;
  SerializedSampleWriter replies_;
  SerializedSampleReader requests_;
  std::deque<WaitingReply> waiting_;
  /// When each client of rmw_cyclonedds asked first.
  std::map<eprosima::fastrtps::rtps::GUID_t, Clock::time_point> first_requests_;
};

}  // namespace stillmap::dds
