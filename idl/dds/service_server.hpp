#pragma once

#include <functional>
#include <string>
#include <thread>
#include <utility>

#include "idl/dds/type_support.hpp"
#include "idl/dds/untyped_service_server.hpp"

namespace stillmap::dds {

/// A reply that can say in words why there is no answer.
template <typename Reply>
concept CarriesRefusal = requires(Reply reply) {
  reply.status().code(std::uint8_t{});
  reply.status().reason(std::string());
};

/// Answers the requests of one ROS 2 service, one at a time, on its own thread, whether they come
/// from rmw_fastrtps or from rmw_cyclonedds. Requests that cannot be read are counted
/// (Participant::service_faults) and refused, where the reply has a status.
template <typename Request, typename Reply>
class ServiceServer {
 public:
  /// `answer` and `idle`, called once a second while nobody asks, must not throw. Throws DdsError
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
    // An invalid request, as stillmap_msgs/ReplyStatus numbers it.
    reply.status().code(1);
    reply.status().reason("the request cannot be read as a " +
                          type_support<Request>().get_type_name() +
                          "; client and server must have the same version of stillmap_msgs");
    return reply;
  }

  std::function<Reply(const Request&)> answer_;
  std::function<void()> idle_;
  UntypedServiceServer server_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap::dds
