#pragma once

#include <optional>
#include <random>

#include "tests/ros/cyclone_peer/endpoints.hpp"

namespace stillmap::peer {

/// Asks a ROS 2 service in the manner of rmw_cyclonedds: requests and replies begin with the
/// client's id and the request's number, and every client sees the replies to all.
template <typename Request, typename Reply>
class RmwClient {
 public:
  RmwClient(const Participant& participant, const std::string& service)
      : requests_(participant, "rq/" + service + "Request", {}),
        replies_(participant, "rr/" + service + "Reply", {}) {}

  /// As rmw_service_server_is_available, until it is.
  [[nodiscard]] bool wait_for_server(std::chrono::milliseconds timeout) const {
    return wait_until([this] { return requests_.is_matched() && replies_.is_matched(); }, timeout);
  }

  /// Asks once. Hands the reply over; false when none came in time.
  [[nodiscard]] bool call(Request request, const std::function<void(const Reply&)>& handle,
                          std::chrono::milliseconds timeout) {
    request.rmw_client = id_;
    request.rmw_sequence = ++asked_;
    requests_.write(request);
    bool is_answered = false;
    const auto look = [&] {
      replies_.take([&](const Reply& reply) {
        if (reply.rmw_client != id_ || reply.rmw_sequence != asked_) return;
        is_answered = true;
        handle(reply);
      });
      return is_answered;
    };
    return wait_until(look, timeout);
  }

 private:
  std::uint64_t id_ = std::random_device{}() * std::uint64_t{4294967291};
  std::int64_t asked_ = 0;
  Writer<Request> requests_;
  Reader<Reply> replies_;
};

}  // namespace stillmap::peer
