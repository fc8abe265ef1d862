#include "server/label_cadence.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace stillmap {
namespace {

/// n grows when the network takes more than its n periods by this much: scans do not come to the
/// millisecond.
constexpr double late_share = 1.05;
/// n shrinks when the network would need no more than this share of the fewer periods.
constexpr double spare_share = 0.85;
constexpr double largest_every = 1000.0;

std::uint32_t periods(double ms, double period_ms) {
  return static_cast<std::uint32_t>(std::clamp(std::ceil(ms / period_ms), 1.0, largest_every));
}

}  // namespace

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

void LabelCadence::scan_segmented(double network_ms, double period_ms) {
  network_ms_.add(network_ms);
  if (period_ms > 0.0) period_ms_.add(period_ms);
  const double ms = network_ms_.value();
  const double usual_period_ms = period_ms_.value();
  if (usual_period_ms <= 0.0) return;
  if (ms > late_share * every_ * usual_period_ms) {
    every_ = periods(ms / late_share, usual_period_ms);
  } else if (ms < spare_share * (every_ - 1) * usual_period_ms) {
    every_ = periods(ms / spare_share, usual_period_ms);
  }
}

}  // namespace stillmap
