#include "server/publishers/status_publisher.hpp"

#include <algorithm>
#include <utility>

#include "idl/conversions/status.hpp"

namespace stillmap::server {
namespace {

// How soon a change of health is told.
constexpr std::chrono::duration<double> poll_period{0.1};

}  // namespace

StatusPublisher::StatusPublisher(dds::Participant& participant, const dds::Topics& topics,
                                 double period_s, std::function<dds::ServerStatus()> status)
    : period_(period_s),
      status_(std::move(status)),
      writer_(participant, topics.status.dds_name, topics.status.writer),
      thread_(std::min(poll_period, period_), [this] { publish_when_due(); }) {}

void StatusPublisher::publish_when_due() {
  const dds::ServerStatus status = status_();
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ < period_ && status.health == last_health_) return;
  last_ = now;
  last_health_ = status.health;
  // A keep-last writer always has room.
  static_cast<void>(writer_.write(wire::to_wire(status)));
}

}  // namespace stillmap::server
