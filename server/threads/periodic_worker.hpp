#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>

namespace stillmap::server {

/// Calls `work` every `period` on its own thread until destroyed; work that takes longer delays the
/// next call.
class PeriodicThread {
 public:
  PeriodicThread(std::chrono::duration<double> period, std::function<void()> work)
      : work_(std::move(work)), thread_([this, period](const std::stop_token& stop) {
          std::mutex mutex;
          std::condition_variable_any never_notified;
          std::unique_lock lock(mutex);
          while (!stop.stop_requested()) {
            work_();
            never_notified.wait_for(lock, stop, period, [] { return false; });
          }
        }) {}

 private:
  std::function<void()> work_;
  std::jthread thread_;
};

}  // namespace stillmap::server
