#pragma once

#include <exception>
#include <functional>
#include <future>
#include <mutex>
#include <utility>
#include <vector>

namespace stillmap::server {

/// Actions that any thread wants one thread to run, between two pieces of its own work.
class RequestQueue {
 public:
  /// Waits for the end of the action, and throws what it throws.
  void run(std::function<void()> action) {
    std::future<void> done;
    {
      const std::scoped_lock lock(mutex_);
      if (is_closed_) return action();
      done = waiting_.emplace_back(std::move(action)).get_future();
    }
    done.get();
  }

  /// Of the one thread: runs those that wait.
  void run_waiting() {
    const std::scoped_lock lock(mutex_);
    for (std::packaged_task<void()>& task : std::exchange(waiting_, {})) task();
  }

  /// The one thread has ended: runs `first`, unless it was closed already, and those that wait;
  /// from now on each runs in the thread that asks, one at a time. Throws what `first` throws.
  void close(const std::function<void()>& first) {
    std::exception_ptr fault;
    {
      const std::scoped_lock lock(mutex_);
      try {
        if (!std::exchange(is_closed_, true)) first();
      } catch (...) {
        fault = std::current_exception();
      }
    }
    run_waiting();
    if (fault) std::rethrow_exception(fault);
  }

 private:
  std::mutex mutex_;
  bool is_closed_ = false;
  std::vector<std::packaged_task<void()>> waiting_;
};

}  // namespace stillmap::server
