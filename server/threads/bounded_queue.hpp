#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <stop_token>
#include <utility>

namespace stillmap::server {

/// A bounded queue between the threads that produce items and those that take them. The producer
/// chooses what happens when it is full: the oldest items are dropped, or the producer waits.
template <typename T>
class BoundedQueue {
 public:
  /// `capacity` >= 1.
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  /// Makes room by dropping the oldest items; returns how many.
  std::size_t push_dropping_oldest(T item) {
    const std::scoped_lock lock(mutex_);
    std::size_t dropped = 0;
    for (; items_.size() >= capacity_; ++dropped) items_.pop_front();
    items_.push_back(std::move(item));
    changed_.notify_all();
    return dropped;
  }

  /// Waits for room. False when a stop was requested: the item was not taken.
  [[nodiscard]] bool push_blocking(T item, const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [this] { return items_.size() < capacity_; })) return false;
    items_.push_back(std::move(item));
    changed_.notify_all();
    return true;
  }

  /// Calls `change(std::deque<T>&)` under the queue's lock, for another order than first in, first
  /// out; `change` has to keep the queue bounded.
  template <typename Change>
  void edit(Change change) {
    const std::scoped_lock lock(mutex_);
    change(items_);
    changed_.notify_all();
  }

  /// Waits until `condition(const std::deque<T>&)` holds. False after `timeout`.
  template <typename Condition>
  bool wait_until(Condition condition, std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, timeout, [&] { return condition(std::as_const(items_)); });
  }

  /// Waits for an item. False after `timeout` or when a stop was requested.
  [[nodiscard]] bool wait_for_item(const std::stop_token& stop, std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, stop, timeout, [this] { return !items_.empty(); });
    return !items_.empty() && !stop.stop_requested();
  }

  /// The next item, if there is one.
  [[nodiscard]] std::optional<T> try_pop() {
    const std::scoped_lock lock(mutex_);
    if (items_.empty()) return std::nullopt;
    std::optional<T> item(std::move(items_.front()));
    items_.pop_front();
    changed_.notify_all();
    return item;
  }

  /// How many items wait to be taken.
  [[nodiscard]] std::size_t waiting() const {
    const std::scoped_lock lock(mutex_);
    return items_.size();
  }

 private:
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<T> items_;
};

}  // namespace stillmap::server
