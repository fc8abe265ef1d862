#include "clients/commands/stage_stopwatch.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap::cli {
namespace {

double ms_between(std::chrono::steady_clock::time_point from,
                  std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double, std::milli>(to - from).count();
}

}  // namespace

double StageDurations::quantile(double share) const {
  if (ms.empty()) return 0.0;
  std::vector<double> sorted = ms;
  std::sort(sorted.begin(), sorted.end());
  const double rank = std::ceil(share * static_cast<double>(sorted.size()));
  const auto index = static_cast<std::size_t>(std::max(rank, 1.0)) - 1;
  return sorted[std::min(index, sorted.size() - 1)];
}

void StageStopwatch::begin() { scan_began_ = stage_began_ = Clock::now(); }

void StageStopwatch::end_stage(std::string_view stage) {
  const auto now = Clock::now();
  auto found = std::find_if(stages_.begin(), stages_.end(),
                            [&](const StageDurations& known) { return known.stage == stage; });
  if (found == stages_.end()) {
    found = stages_.insert(stages_.end(), {.stage = std::string(stage), .ms = {}});
  }
  found->ms.push_back(ms_between(stage_began_, now));
  stage_began_ = now;
}

void StageStopwatch::end() { total_.ms.push_back(ms_between(scan_began_, Clock::now())); }

std::vector<StageDurations> StageStopwatch::stages() const {
  std::vector<StageDurations> all = stages_;
  all.push_back(total_);
  return all;
}

}  // namespace stillmap::cli
