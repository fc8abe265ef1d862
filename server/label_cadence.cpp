#include "server/label_cadence.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// n grows when the network takes more than the room in its n periods by this much: scans do not
/// come to the millisecond.
constexpr double late_share = 1.05;
/// n shrinks when the network would need no more than this share of the room in fewer.
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
  network_ms_.add(network_ms);
  if (period_ms > 0.0) period_ms_.add(period_ms);
  const double ms = network_ms_.value();
  const double usual_period_ms = period_ms_.value();
  if (usual_period_ms <= 0.0 || network_ms_.size() < fewest_runs) return;
  const double room_ms = std::max(usual_period_ms - besides_ms, least_room * usual_period_ms);
  if (ms > late_share * every_ * room_ms) {
    every_ = periods(ms / late_share, room_ms);
  } else if (ms < spare_share * (every_ - 1) * room_ms) {
    every_ = periods(ms / spare_share, room_ms);
  }
}

}  // namespace stillmap
