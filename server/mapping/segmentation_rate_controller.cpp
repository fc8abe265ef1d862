#include "server/mapping/segmentation_rate_controller.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// The pace slows when the network takes more than the room in its n periods by this much: scans do
/// not come to the millisecond.
constexpr double late_share = 1.05;
/// It quickens to one at which the network would need no more than this share of the room.
constexpr double spare_share = 0.85;
/// The first run of all takes longer than the others: memory and threads are new.
constexpr std::size_t fewest_runs = 3;
constexpr double largest_every = 1000.0;
/// A minute of a usual sensor's scans.
constexpr int most_patience = 600;
/// Even where all else fills the period, the network gets this share of it.
constexpr double least_room = 0.1;

/// How many rooms of this length hold so much.
std::uint32_t periods(double ms, double room_ms) {
  return static_cast<std::uint32_t>(std::clamp(std::ceil(ms / room_ms), 1.0, largest_every));
}

}  // namespace

void LabelCadence::scan_segmented(double network_ms, double besides_ms, double period_ms) {
  network_ms_.add(network_ms);
  runs_ = std::min(runs_ + 1, most_patience);
  if (period_ms > 0.0) period_ms_.add(period_ms);
  const double usual_period_ms = period_ms_.value();
  if (usual_period_ms <= 0.0 || network_ms_.size() < fewest_runs) return;
  const double room_ms = std::max(usual_period_ms - besides_ms, least_room * usual_period_ms);
  if (network_ms_.value() > late_share * pace_.every * room_ms) {
    change_to(first_within(late_share, room_ms));
  } else {
    Pace faster = std::min(pace_, first_within(spare_share, room_ms));
    // Where a closer look at every scan would fit, this one at every scan does.
    if (faster.coarseness < pace_.coarseness && runs_ < patience_) {
      faster = {.coarseness = pace_.coarseness, .every = 1};
    }
    change_to(faster);
  }
}

double LabelCadence::network_ms() const {
  return network_ms_.size() > 0 ? network_ms_.value() : expected_ms_;
}

void LabelCadence::change_to(Pace pace) {
  if (pace.coarseness != pace_.coarseness) {
    expected_ms_ = finest_ms() * costs_[pace.coarseness];
    network_ms_ = RecentMedian(runs_looked_at);
    if (pace.coarseness > pace_.coarseness) {
      patience_ = runs_ < patience_ ? std::min(2 * patience_, most_patience) : least_patience;
    }
    runs_ = 0;
  }
  pace_ = pace;
}

LabelCadence::Pace LabelCadence::first_within(double share, double room_ms) const {
  const auto fits = [&](double cost) { return finest_ms() * cost <= share * room_ms; };
  const auto found = std::ranges::find_if(costs_, fits);
  if (found != costs_.end()) {
    return {.coarseness = static_cast<std::size_t>(found - costs_.begin()), .every = 1};
  }
  return {.coarseness = costs_.size() - 1,
          .every = periods(finest_ms() * costs_.back() / share, room_ms)};
}

}  // namespace stillmap
