#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/traversability/traversability_view.hpp"

namespace stillmap::server {

/// The areas of all robots as of the last update: immutable views, so that nobody waits for
/// anybody. Thread-safe.
class TraversabilitySnapshot {
 public:
  /// One view a robot.
  using Views = std::vector<std::shared_ptr<const TraversabilityView>>;

  void publish(Views views);

  /// Throws std::invalid_argument, naming the robots that there are, for any other.
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(const std::string& profile) const;

 private:
  mutable std::mutex mutex_;
  Views views_;
};

}  // namespace stillmap::server
