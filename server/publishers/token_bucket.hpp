#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace stillmap {

/// Bytes that may be sent: a rate, and a second's worth of it saved up at most. Not thread-safe.
class ByteAllowance {
 public:
  using Clock = std::chrono::steady_clock;

  /// 0: any number of bytes.
  explicit ByteAllowance(std::uint32_t bytes_per_s) : bytes_per_s_(bytes_per_s) {}

  /// Gives what time has brought since the last call.
  void refill(Clock::time_point now);
  /// Whether something may be sent now. A message may be larger than what is left: the debt is
  /// waited for afterwards.
  [[nodiscard]] bool allows() const { return bytes_per_s_ == 0.0 || bytes_left_ > 0.0; }
  void spend(std::size_t bytes) { bytes_left_ -= static_cast<double>(bytes); }

 private:
  double bytes_per_s_;
  double bytes_left_ = 0.0;
  std::optional<Clock::time_point> refilled_;
};

}  // namespace stillmap
