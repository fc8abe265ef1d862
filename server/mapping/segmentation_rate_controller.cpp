#include "server/mapping/segmentation_rate_controller.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap::server {
namespace {

/// The rate falls when the network takes this many times the time in its n periods: scans do not
/// come to the millisecond.
constexpr double late_share = 1.05;
/// It rises to one at which the network would need at most this share of the time.
constexpr double spare_share = 0.85;
/// The very first runs take longer than the others: memory and threads are new.
constexpr std::size_t min_runs = 3;
constexpr double max_every = 1000.0;
/// A minute of a usual sensor's scans.
constexpr int max_patience = 600;
/// Even where other work fills the period, the network gets this share of it.
constexpr double min_room_share = 0.1;

/// How many periods with `room_ms` each hold `ms`.
std::uint32_t periods(double ms, double room_ms) {
  return static_cast<std::uint32_t>(std::clamp(std::ceil(ms / room_ms), 1.0, max_every));
}

}  // namespace

void SegmentationRateController::add_measurement(double network_ms, double other_stages_ms,
                                                 double period_ms) {
  network_ms_.add(network_ms);
  runs_ = std::min(runs_ + 1, max_patience);
  if (period_ms > 0.0) period_ms_.add(period_ms);
  const double usual_period_ms = period_ms_.value();
  if (usual_period_ms <= 0.0) return;
  room_ms_ = std::max(usual_period_ms - other_stages_ms, min_room_share * usual_period_ms);
  if (network_ms_.size() < min_runs) return;
  if (network_ms_.value() > late_share * rate_.every * room_ms_) {
    change_to(first_within(late_share, room_ms_));
  } else {
    Rate faster = std::min(rate_, first_within(spare_share, room_ms_));
    // Where a finer resolution would fit for every scan, the present one does.
    if (faster.resolution_level < rate_.resolution_level && runs_ < patience_) {
      faster = {.resolution_level = rate_.resolution_level, .every = 1};
    }
    change_to(faster);
  }
}

double SegmentationRateController::network_ms() const {
  return network_ms_.size() > 0 ? network_ms_.value() : expected_ms_;
}

void SegmentationRateController::change_to(Rate rate) {
  if (rate.resolution_level != rate_.resolution_level) {
    expected_ms_ = finest_ms() * costs_[rate.resolution_level];
    network_ms_ = RecentMedian(median_window);
    if (rate.resolution_level > rate_.resolution_level) {
      patience_ = runs_ < patience_ ? std::min(2 * patience_, max_patience) : min_patience;
    }
    runs_ = 0;
  }
  rate_ = rate;
}

SegmentationRateController::Rate SegmentationRateController::first_within(double share,
                                                                          double room_ms) const {
  const auto fits = [&](double cost) { return finest_ms() * cost <= share * room_ms; };
  const auto found = std::ranges::find_if(costs_, fits);
  if (found != costs_.end()) {
    return {.resolution_level = static_cast<std::size_t>(found - costs_.begin()), .every = 1};
  }
  return {.resolution_level = costs_.size() - 1,
          .every = periods(finest_ms() * costs_.back() / share, room_ms)};
}

}  // namespace stillmap::server
