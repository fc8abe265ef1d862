#pragma once

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "idl/dds/serialized_sample.hpp"
#include "idl/dds/service_faults.hpp"
#include "idl/dds/service_identity.hpp"
#include "idl/dds/type_support.hpp"
#include "stillmap_msgs.h"

namespace stillmap::dds {

/// Which client sent a request, and how the reply is correlated with it.
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
  /// meanwhile sends replies whose readers were discovered. Nothing after `timeout`, on a stop, or
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

/// A reply that can say in words why there is no answer.
template <typename Reply>
concept CarriesRefusal = requires(Reply reply) {
  reply.status().code(std::uint8_t{});
  reply.status().reason(std::string());
};

/// Answers the requests of one ROS 2 service, one at a time, on its own thread, from clients of
/// rmw_fastrtps and rmw_cyclonedds. Requests that cannot be read are counted
/// (Participant::service_faults) and refused, where the reply has a status.
template <typename Request, typename Reply>
class ServiceServer {
 public:
  /// `answer` and `idle`, called once a second without requests, must not throw. Throws DdsError
  /// when the topics cannot be made.
  ServiceServer(
      Participant& participant, const std::string& service,
      std::function<Reply(const Request&)> answer, std::function<void()> idle = [] {})
      : answer_(std::move(answer)),
        idle_(std::move(idle)),
        server_(participant, service, type_support<Request>(), type_support<Reply>()),
        thread_([this](const std::stop_token& stop) { serve(stop); }) {}

 private:
  void serve(const std::stop_token& stop) {
    Request request;
    while (!stop.stop_requested()) {
      const auto call = server_.take(&request, stop, std::chrono::seconds(1));
      if (!call) {
        idle_();
        continue;
      }
      if (call->is_readable) {
        const Reply reply = answer_(request);
        server_.send_reply(*call, &reply);
      } else if constexpr (CarriesRefusal<Reply>) {
        const Reply reply = refusal();
        server_.send_reply(*call, &reply);
      }
    }
  }

  static Reply refusal() {
    Reply reply;
    reply.status().code(stillmap_msgs::msg::ReplyStatus_Constants::INVALID_REQUEST);
    reply.status().reason("the request cannot be read as a " +
                          type_support<Request>().get_type_name() +
                          "; client and server must have the same version of stillmap_msgs");
    return reply;
  }

  std::function<Reply(const Request&)> answer_;
  std::function<void()> idle_;
  UntypedServiceServer server_;
  // Last member: stops before the others are destroyed.
  std::jthread thread_;
};

}  // namespace stillmap::dds
