#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <thread>

namespace stillmap::server {

/// How long after the begin of a save the next one is due: that one is to have ended `period` after
/// this one began, so that what a killed server loses is no older. `longest` is what saves took
/// lately. At least half of the period.
[[nodiscard]] std::chrono::duration<double> due_after_begin(std::chrono::duration<double> period,
                                                            std::chrono::duration<double> longest);

/// Saves again and again in a thread of its own until destroyed.
class CheckpointThread {
 public:
  CheckpointThread(std::chrono::duration<double> period, std::function<void()> save);

 private:
  void work(const std::stop_token& stop, std::chrono::duration<double> period) const;

  std::function<void()> save_;
  std::jthread thread_;
};

}  // namespace stillmap::server
