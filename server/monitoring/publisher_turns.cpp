#include "server/monitoring/publisher_turns.hpp"

namespace stillmap::server {
namespace {

constexpr std::chrono::seconds window{30};
/// Of a publisher that gives way to another one, some last samples may come late.
constexpr std::size_t enough_returns = 4;

}  // namespace

void PublisherTurns::add(const std::string& writer_guid, Clock::time_point now) {
  const std::scoped_lock lock(mutex_);
  std::erase_if(sent_, [&](const auto& sent) { return now - sent.second > window; });
  const bool has_sent = !sent_.insert_or_assign(writer_guid, now).second;
  if (has_sent && writer_guid != last_) returns_.push_back(now);
  if (returns_.size() > enough_returns) returns_.pop_front();
  last_ = writer_guid;
}

std::vector<std::string> PublisherTurns::publishers(Clock::time_point now) const {
  const std::scoped_lock lock(mutex_);
  if (returns_.size() < enough_returns || now - returns_.front() > window) return {};
  std::vector<std::string> publishers;
  for (const auto& [writer_guid, sent] : sent_)
    if (now - sent <= window) publishers.push_back(writer_guid);
  return publishers;
}

}  // namespace stillmap::server
