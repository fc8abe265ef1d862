#pragma once

#include <deque>
#include <functional>
#include <mutex>
#include <utility>

#include "clients/gateway/post.hpp"
#include "tests/eventually.hpp"

namespace stillmap::gateway {

/// What other threads post, done in the test's own thread while it waits.
class PostedWork {
 public:
  [[nodiscard]] Post post() {
    return [this](std::function<void()> work) {
      const std::scoped_lock lock(mutex_);
      waiting_.push_back(std::move(work));
    };
  }

  [[nodiscard]] bool eventually(const std::function<bool()>& condition,
                                std::chrono::milliseconds timeout = test::patience) {
    return test::eventually(
        [&] {
          do_all();
          return condition();
        },
        timeout);
  }

  [[nodiscard]] bool has_some() {
    const std::scoped_lock lock(mutex_);
    return !waiting_.empty();
  }

 private:
  void do_all() {
    while (const std::function<void()> work = next()) work();
  }

  std::function<void()> next() {
    const std::scoped_lock lock(mutex_);
    if (waiting_.empty()) return nullptr;
    std::function<void()> work = std::move(waiting_.front());
    waiting_.pop_front();
    return work;
  }

  std::mutex mutex_;
  std::deque<std::function<void()>> waiting_;
};

}  // namespace stillmap::gateway
