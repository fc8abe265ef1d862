#include "server/monitoring/recent_median.hpp"

#include <algorithm>
#include <vector>

namespace stillmap::server {

void RecentMedian::add(double value) {
  last_.push_back(value);
  if (last_.size() > window_) last_.pop_front();
}

double RecentMedian::value() const {
  if (last_.empty()) return 0.0;
  std::vector<double> sorted(last_.begin(), last_.end());
  std::ranges::sort(sorted);
  return sorted[sorted.size() / 2];
}

}  // namespace stillmap::server
