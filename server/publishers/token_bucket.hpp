#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace stillmap::server {

/// Bytes that may be sent: a rate, and a second's worth of it saved up at most. Not thread-safe.
class TokenBucket {
 public:
  using Clock = std::chrono::steady_clock;

  /// 0: any number of bytes.
  explicit TokenBucket(std::uint32_t bytes_per_s) : bytes_per_s_(bytes_per_s) {}

  /// Gives what time has brought since the last call.
  void refill(Clock::time_point now);
  /// Whether something may be sent now. A message may be larger than what is left: the debt is
  /// waited for afterwards.
  [[nodiscard]] bool has_tokens() const { return bytes_per_s_ == 0.0 || tokens_ > 0.0; }
  void consume(std::size_t bytes) { tokens_ -= static_cast<double>(bytes); }

 private:
  double bytes_per_s_;
  double tokens_ = 0.0;
  std::optional<Clock::time_point> refilled_;
};

}  // namespace stillmap::server
