#include "server/publishers/token_bucket.hpp"

#include <algorithm>

namespace stillmap {

void ByteAllowance::refill(Clock::time_point now) {
  const double seconds = refilled_ ? std::chrono::duration<double>(now - *refilled_).count() : 1.0;
  bytes_left_ = std::min(bytes_left_ + seconds * bytes_per_s_, bytes_per_s_);
  refilled_ = now;
}

}  // namespace stillmap
