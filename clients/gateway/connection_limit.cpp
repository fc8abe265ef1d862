#include "clients/gateway/connection_limit.hpp"

#include <algorithm>
#include <utility>

namespace stillmap::gateway {

ConnectionLimit::Lease::~Lease() {
  limit_->leases_.erase(place_);
  if (limit_->freed_) limit_->freed_();
}

void ConnectionLimit::Lease::raise(Standing standing) { standing_ = std::max(standing_, standing); }

std::shared_ptr<ConnectionLimit::Lease> ConnectionLimit::lend() {
  const auto place = leases_.insert(leases_.end(), nullptr);
  auto lease = std::make_shared<Lease>(shared_from_this(), place);
  *place = lease.get();
  return lease;
}

void ConnectionLimit::close_one() {
  const auto oldest_of_least = std::ranges::min_element(
      leases_, {}, [](const Lease* lease) { return std::pair(!lease->close_, lease->standing_); });
  if (oldest_of_least == leases_.end()) return;
  Lease& lease = **oldest_of_least;
  if (lease.standing_ == Standing::session || !lease.close_) return;
  std::exchange(lease.close_, nullptr)();
}

}  // namespace stillmap::gateway
