#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "server/monitoring/recent_median.hpp"

namespace stillmap {

/// How coarsely scans are segmented, and which: every n-th. As finely as the label source and all
/// else that is done with a scan keep the sensor's rate; every n-th only where it does not at its
/// coarsest, n the smallest with which it does. It grows coarser and rarer at once, and finer and
/// more frequent with some room to spare, so that it does not swing.
class LabelCadence {
 public:
  /// LabelSource::costs().
  explicit LabelCadence(std::vector<double> costs = {1.0}) : costs_(std::move(costs)) {}

  /// A scan took so long at the present coarseness, `besides_ms` is what else is done with each,
  /// and scans come so fast (0: not known).
  void scan_segmented(double network_ms, double besides_ms, double period_ms);

  /// Never 0.
  [[nodiscard]] std::uint32_t every() const { return pace_.every; }
  /// An index of the source's costs.
  [[nodiscard]] std::size_t coarseness() const { return pace_.coarseness; }
  /// What a scan takes at the present pace; before the first run at it what it should.
  [[nodiscard]] double network_ms() const;
  /// Time from scan to scan as the sensor sends them.
  [[nodiscard]] double period_ms() const { return period_ms_.value(); }

 private:
  static constexpr std::size_t runs_looked_at = 5;
  static constexpr int least_patience = 10;

  /// In the order in which they are to be preferred.
  struct Pace {
    std::size_t coarseness = 0;
    std::uint32_t every = 1;
    auto operator<=>(const Pace&) const = default;
  };

  /// What a scan takes at the finest, or would take.
  [[nodiscard]] double finest_ms() const { return network_ms() / costs_[pace_.coarseness]; }
  /// The first with which the network takes this share of the room that it has, or less.
  [[nodiscard]] Pace first_within(double share, double room_ms) const;
  void change_to(Pace pace);

  std::vector<double> costs_;
  /// At the present coarseness.
  RecentMedian network_ms_{runs_looked_at};
  RecentMedian period_ms_{9};
  Pace pace_;
  /// What a scan should take at it, by what it took at the one before.
  double expected_ms_ = 0.0;
  /// Scans looked at since the coarseness changed, and how many it takes before a closer look is
  /// tried: more each time that one did not last.
  int runs_ = 0;
  int patience_ = least_patience;
};

}  // namespace stillmap
