#include "core/lidar/turn_joiner.hpp"

#include <utility>

namespace stillmap {

TurnJoiner::TurnJoiner(std::size_t clouds_per_turn)
    : is_told_(clouds_per_turn != automatic),
      clouds_per_turn_(clouds_per_turn),
      counter_(clouds_per_turn) {}

void TurnJoiner::settle(std::size_t clouds_per_turn) {
  if (clouds_per_turn == clouds_per_turn_) return;
  clouds_per_turn_ = clouds_per_turn;
  counter_ = TurnCounter(clouds_per_turn);
}

void TurnJoiner::release(std::vector<Scan>& scans) {
  if (!parts_.empty()) scans.push_back(joined_turn(std::exchange(parts_, {})));
}

std::vector<Scan> TurnJoiner::add(Scan cloud) {
  if (!is_told_) {
    recognition_.learn({.stamp_ns = cloud.stamp_ns, .arc = viewed_arc(cloud.points_lidar)});
    settle(recognition_.clouds_per_turn());
  }
  waiting_.push_back(std::move(cloud));
  std::vector<Scan> scans;
  if (clouds_per_turn_ == automatic) {
    const bool waits = recognition_.is_comparing() && waiting_.size() < most;
    return waits ? scans : flush();
  }
  for (Scan& part : std::exchange(waiting_, {})) {
    if (counter_.begins_turn(part.stamp_ns)) release(scans);
    parts_.push_back(std::move(part));
    if (counter_.is_complete()) release(scans);
  }
  return scans;
}

std::vector<Scan> TurnJoiner::flush() {
  std::vector<Scan> scans;
  release(scans);
  for (Scan& cloud : std::exchange(waiting_, {})) scans.push_back(std::move(cloud));
  return scans;
}

}  // namespace stillmap
