#pragma once

#include <algorithm>
#include <chrono>

#include "idl/dds/dds_options.hpp"

namespace stillmap {

/// When to join the domain anew, because nobody was found. With Fast DDS 2.9, an answer over TCP
/// that comes before its question is noted is lost, and with it the port that it opens, for good:
/// TCPChannelResource::add_logical_port. Over UDP it is never time.
class TcpPatience {
 public:
  using Clock = std::chrono::steady_clock;

  explicit TcpPatience(const DdsOptions& options)
      : is_tcp_(options.transport == NetworkTransport::tcp), due_(Clock::now() + step_) {}

  /// How long to wait for others before asking again whether it is time.
  [[nodiscard]] std::chrono::milliseconds wait(std::chrono::milliseconds longest) const {
    if (!is_tcp_) return longest;
    const auto until_due = std::chrono::ceil<std::chrono::milliseconds>(due_ - Clock::now());
    return std::max(std::min(until_due, longest), std::chrono::milliseconds(0));
  }

  /// True when it is time; the next time is then twice as far away.
  [[nodiscard]] bool is_over() {
    if (!is_tcp_ || Clock::now() < due_) return false;
    step_ *= 2;
    due_ = Clock::now() + step_;
    return true;
  }

 private:
  bool is_tcp_;
  std::chrono::milliseconds step_{4000};
  Clock::time_point due_;
};

}  // namespace stillmap
