#pragma once

#include <chrono>
#include <deque>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace stillmap::server {

/// Which publishers send on a topic in turns, where one is expected. One that another one follows
/// for good, as after a restart, is not among them. Thread-safe.
class PublisherTurns {
 public:
  using Clock = std::chrono::steady_clock;

  /// A sample of this publisher arrived.
  void add(const std::string& writer_guid, Clock::time_point now);

  /// Those between which the topic went to and fro over the last half minute, in the order of their
  /// names; empty where it did not.
  [[nodiscard]] std::vector<std::string> publishers(Clock::time_point now) const;

 private:
  mutable std::mutex mutex_;
  std::string last_;
  /// When each sent last.
  std::map<std::string, Clock::time_point> sent_;
  /// When one sent that had sent before another did.
  std::deque<Clock::time_point> returns_;
};

}  // namespace stillmap::server
