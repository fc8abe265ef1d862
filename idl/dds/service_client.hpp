#pragma once

#include <algorithm>
#include <chrono>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "idl/dds/reader.hpp"
#include "idl/dds/service_identity.hpp"
#include "idl/dds/writer.hpp"
#include "idl/security/security_error.hpp"

namespace stillmap {

/// Asks one ROS 2 service. Thread-safe: requests wait for each other.
template <typename Request, typename Reply>
class ServiceClient {
 public:
  /// Throws DdsError when the topics cannot be made. A service that our permissions forbid is known
  /// by refusal(); only asking it fails.
  ServiceClient(Participant& participant, const std::string& service) {
    try {
      requests_.emplace(participant, request_topic(service), service_qos());
      replies_.emplace(participant, reply_topic(service), service_qos());
    } catch (const NotPermitted& error) {
      refusal_ = error.what();
    }
  }

  /// Why this service must not be asked; empty when it may be.
  [[nodiscard]] const std::string& refusal() const { return refusal_; }

  /// True once both of the server's ends are discovered; false after `timeout`. Throws
  /// NotPermitted.
  [[nodiscard]] bool wait_for_server(std::chrono::milliseconds timeout) const {
    if (!refusal_.empty()) throw NotPermitted(refusal_);
    const auto deadline = std::chrono::steady_clock::now() + timeout;
    return requests_->readers().wait_for_any(timeout) &&
           replies_->events().wait_for_writer(left_until(deadline));
  }

  /// Throws NotPermitted for a service that our permissions forbid. The answer; nothing after
  /// `timeout`. A request is sent again at half time: a server that was just restarted may have
  /// lost the first, and the first answer that comes is taken.
  [[nodiscard]] std::optional<Reply> ask(const Request& request,
                                         std::chrono::milliseconds timeout) {
    const std::scoped_lock lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (!wait_for_server(timeout)) return std::nullopt;
    sent_.clear();
    for (const auto deadline : {now + timeout / 2, now + timeout}) {
      send(request);
      if (auto reply = receive(deadline)) return reply;
    }
    return std::nullopt;
  }

 private:
  using Clock = std::chrono::steady_clock;

  static std::chrono::milliseconds left_until(Clock::time_point deadline) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
    return std::max(left, std::chrono::milliseconds(0));
  }

  void send(const Request& request) {
    eprosima::fastrtps::rtps::WriteParams params;
    params.related_sample_identity().writer_guid() = replies_->guid();
    if (requests_->write(request, params)) sent_.push_back(params.sample_identity());
  }

  std::optional<Reply> receive(Clock::time_point deadline) {
    Reply reply;
    eprosima::fastdds::dds::SampleInfo info;
    while (replies_->take(reply, info, {}, left_until(deadline))) {
      if (is_ours(info.related_sample_identity)) return reply;
    }
    return std::nullopt;
  }

  // Everybody's replies come by here.
  bool is_ours(const eprosima::fastrtps::rtps::SampleIdentity& answered) const {
    return std::ranges::any_of(sent_, [&](const auto& request) {
      return answered.sequence_number() == request.sequence_number() &&
             (answered.writer_guid() == replies_->guid() ||
              answered.writer_guid() == request.writer_guid());
    });
  }

  std::mutex mutex_;
  std::vector<eprosima::fastrtps::rtps::SampleIdentity> sent_;
  std::string refusal_;
  std::optional<Reader<Reply>> replies_;
  std::optional<Writer<Request>> requests_;
};

}  // namespace stillmap
