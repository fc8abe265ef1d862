#include "server/label_cadence.hpp"

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
/// Even where all else fills the period, the network gets this share of it.
constexpr double least_room = 0.1;

/// How many rooms of this length hold so much.
std::uint32_t periods(double ms, double room_ms) {
  return static_cast<std::uint32_t>(std::clamp(std::ceil(ms / room_ms), 1.0, largest_every));
}

}  // namespace

void LabelCadence::scan_segmented(double network_ms, double besides_ms, double period_ms) {
  finest_ms_.add(network_ms / cost(pace_.coarseness));
  if (period_ms > 0.0) period_ms_.add(period_ms);
  const double usual_period_ms = period_ms_.value();
  if (usual_period_ms <= 0.0 || finest_ms_.size() < fewest_runs) return;
  const double room_ms = std::max(usual_period_ms - besides_ms, least_room * usual_period_ms);
  if (finest_ms_.value() * cost(pace_.coarseness) > late_share * pace_.every * room_ms) {
    pace_ = first_within(late_share, room_ms);
  } else {
    pace_ = std::min(pace_, first_within(spare_share, room_ms));
  }
}

LabelCadence::Pace LabelCadence::first_within(double share, double room_ms) const {
  const auto fits = [&](double cost) { return finest_ms_.value() * cost <= share * room_ms; };
  const auto found = std::ranges::find_if(costs_, fits);
  if (found != costs_.end()) {
    return {.coarseness = static_cast<std::size_t>(found - costs_.begin()), .every = 1};
  }
  return {.coarseness = costs_.size() - 1,
          .every = periods(finest_ms_.value() * costs_.back() / share, room_ms)};
}

}  // namespace stillmap
