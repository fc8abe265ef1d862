#pragma once

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace stillmap::cli {

/// Milliseconds of many runs of one stage.
struct StageDurations {
  std::string stage;
  std::vector<double> ms;

  /// The value that `share` of the runs do not exceed; 0 without runs.
  [[nodiscard]] double quantile(double share) const;
};

/// Stopwatch of a pipeline: the time since the last call counts for the stage that just ended.
class StageStopwatch {
 public:
  void begin();
  void end_stage(std::string_view stage);
  /// Ends the whole scan, whose time counts as "total".
  void end();

  /// In the order in which stages first ended; "total" is last.
  [[nodiscard]] std::vector<StageDurations> stages() const;
  [[nodiscard]] const StageDurations& total() const { return total_; }

 private:
  using Clock = std::chrono::steady_clock;

  Clock::time_point scan_began_;
  Clock::time_point stage_began_;
  std::vector<StageDurations> stages_;
  StageDurations total_{.stage = "total", .ms = {}};
};

}  // namespace stillmap::cli
