#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "server/threads/bounded_queue.hpp"
#include "server/threads/thread_failure.hpp"
#include "server/threads/thread_name.hpp"

namespace stillmap::server {

struct WorkerOptions {
  /// Called once, on the worker's thread, before anything else.
  std::function<void()> on_start = {};
  /// Called when an item waits, before it is taken: what waits may change meanwhile.
  std::function<void()> before_take = {};
  /// Called when no item came for `idle_period`.
  std::function<void()> on_idle = {};
  std::chrono::milliseconds idle_period = std::chrono::hours(1);
  /// Handles what still waits when it is stopped, instead of leaving it in the queue.
  bool finishes_queue = false;
  /// Called on the worker's thread, as the last thing, when `handle` or one of these threw.
  std::function<void()> on_failure = {};
};

/// Takes items from a queue and hands them to `handle`, one at a time, on a thread of its own.
/// Several may take from one queue, where `handle` stands that.
template <typename T>
class Worker {
 public:
  /// The queue must outlive the worker. The thread has the name (name_this_thread). What `handle`
  /// and the options throw ends the worker and is reported (run_or_report).
  Worker(std::string name, BoundedQueue<T>& queue, std::function<void(T)> handle,
         WorkerOptions options = {})
      : queue_(queue),
        handle_(std::move(handle)),
        options_(std::move(options)),
        thread_([this, name = std::move(name)](const std::stop_token& stop) {
          name_this_thread(name);
          run_or_report([&] { run(stop); }, options_.on_failure);
        }) {}

  /// Ends after the item in work, and waits for that.
  void stop() { thread_ = {}; }

 private:
  void run(const std::stop_token& stop) {
    call(options_.on_start);
    while (!stop.stop_requested()) {
      if (queue_.wait_for_item(stop, options_.idle_period)) {
        call(options_.before_take);
        if (!stop.stop_requested()) handle_next();
      } else if (!stop.stop_requested()) {
        call(options_.on_idle);
      }
    }
    while (options_.finishes_queue && handle_next()) {
    }
  }

  bool handle_next() {
    auto item = queue_.try_pop();
    if (!item) return false;
    handle_(*std::move(item));
    return true;
  }

  static void call(const std::function<void()>& callback) {
    if (callback) callback();
  }

  BoundedQueue<T>& queue_;
  std::function<void(T)> handle_;
  WorkerOptions options_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap::server
