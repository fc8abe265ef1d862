#pragma once

#include <algorithm>
#include <chrono>

#include "idl/dds/dds_options.hpp"

namespace stillmap {

/// When to join the domain anew while waiting for a peer over TCP. With Fast DDS 2.9, an answer to
/// the opening of a port that comes before the request is registered is lost, and the port never
/// opens (TCPChannelResource::add_logical_port). Over UDP it is never due.
class TcpRejoinBackoff {
 public:
  using Clock = std::chrono::steady_clock;

  TcpRejoinBackoff(const dds::DdsOptions& options, std::chrono::milliseconds timeout)
      : is_tcp_(options.transport == dds::NetworkTransport::tcp),
        due_(Clock::now() + step_),
        deadline_(Clock::now() + timeout) {}

  /// How long to wait now.
  [[nodiscard]] std::chrono::milliseconds next_wait() const {
    const auto until = may_rejoin() ? std::min(due_, deadline_) : deadline_;
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now());
    return std::max(left, std::chrono::milliseconds(0));
  }

  /// The timeout has passed.
  [[nodiscard]] bool timed_out() const { return Clock::now() >= deadline_; }

  /// True when it is time to join anew; the next time is then twice as far away. Never so late that
  /// the new try would be shorter than the last.
  [[nodiscard]] bool rejoin_due() {
    if (!may_rejoin() || Clock::now() < due_) return false;
    step_ *= 2;
    due_ = Clock::now() + step_;
    return true;
  }

 private:
  [[nodiscard]] bool may_rejoin() const { return is_tcp_ && due_ + step_ <= deadline_; }

  bool is_tcp_;
  std::chrono::milliseconds step_{4000};
  Clock::time_point due_;
  Clock::time_point deadline_;
};

}  // namespace stillmap
