#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "idl/interface/participant_diagnostics.hpp"

namespace stillmap::server {

/// Scans of each publisher that arrived, and that did not, over the last half minute to minute.
/// Thread-safe.
class ScanLossWindow {
 public:
  using Clock = std::chrono::steady_clock;

  /// A scan arrived, and so many directly before it did not.
  void add(const std::string& writer_guid, std::uint64_t lost, Clock::time_point now);

  /// The publishers whose scans got lost.
  [[nodiscard]] std::vector<dds::ScanLosses> losses(Clock::time_point now) const;

 private:
  struct Counts {
    std::uint64_t received = 0;
    std::uint64_t lost = 0;
  };
  using Window = std::map<std::string, Counts>;

  void advance(Clock::time_point now) const;

  mutable std::mutex mutex_;
  mutable Window current_;
  mutable Window previous_;
  mutable Clock::time_point current_since_;
};

}  // namespace stillmap::server
