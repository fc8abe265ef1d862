#include "clients/gateway/connection_limit.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace stillmap::gateway {

ConnectionLimit::Lease::~Lease() {
  if (!place_) return;
  limit_->leases_.erase(*place_);
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
  if (leases_.empty()) return;
  const auto newest = std::prev(leases_.end());
  const auto oldest_of_least =
      std::min_element(leases_.begin(), newest,
                       [](const Lease* a, const Lease* b) { return a->standing_ < b->standing_; });
  if (oldest_of_least == newest) return;
  Lease& lease = **oldest_of_least;
  if (lease.standing_ == Standing::session || !lease.close_) return;
  // What it still waits for, as for a tile, keeps nobody waiting.
  leases_.erase(*std::exchange(lease.place_, std::nullopt));
  std::exchange(lease.close_, nullptr)();
}

}  // namespace stillmap::gateway
