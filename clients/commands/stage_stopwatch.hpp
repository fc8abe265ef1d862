#pragma once

#include <chrono>
#include <string>
#include <string_view>
#include <vector>

namespace stillmap {

/// Milliseconds of many runs of one stage.
struct StageTime {
  std::string stage;
  std::vector<double> ms;

  /// The value that `share` of the runs do not exceed; 0 without runs.
  [[nodiscard]] double quantile(double share) const;
};

/// Stopwatch of a pipeline: the time since the last call counts for the stage that just ended.
class StageTimes {
 public:
  void begin();
  void end_stage(std::string_view stage);
  /// Ends the whole scan, whose time counts as "total".
  void end();

  /// In the order in which stages first ended; "total" is last.
  [[nodiscard]] std::vector<StageTime> stages() const;
  [[nodiscard]] const StageTime& total() const { return total_; }

 private:
  using Clock = std::chrono::steady_clock;

  Clock::time_point scan_began_;
  Clock::time_point stage_began_;
  std::vector<StageTime> stages_;
  StageTime total_{.stage = "total", .ms = {}};
};

}  // namespace stillmap
