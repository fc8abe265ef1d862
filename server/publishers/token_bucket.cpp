#include "server/publishers/token_bucket.hpp"

#include <algorithm>

namespace stillmap::server {

void TokenBucket::refill(Clock::time_point now) {
  const double seconds = refilled_ ? std::chrono::duration<double>(now - *refilled_).count() : 1.0;
  tokens_ = std::min(tokens_ + seconds * bytes_per_s_, bytes_per_s_);
  refilled_ = now;
}

}  // namespace stillmap::server
