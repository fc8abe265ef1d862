#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>

#include "server/monitoring/duration_histogram.hpp"

namespace stillmap::server {

/// How saving the map went. Thread-safe.
class CheckpointLog {
 public:
  struct Record {
    /// Of those that were stored.
    DurationHistogram times;
    std::uint64_t failures = 0;
    std::optional<std::chrono::system_clock::time_point> last_stored;
  };

  /// One save: a failure unless `stored()` was called before it goes.
  class Attempt {
   public:
    explicit Attempt(CheckpointLog& log) : log_(log) {}
    ~Attempt();
    Attempt(const Attempt&) = delete;
    Attempt& operator=(const Attempt&) = delete;
    void stored() { is_stored_ = true; }

   private:
    CheckpointLog& log_;
    std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
    bool is_stored_ = false;
  };

  [[nodiscard]] Record record() const;

 private:
  mutable std::mutex mutex_;
  Record record_;
};

}  // namespace stillmap::server
