#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <string>
#include <vector>

#include "core/segmentation_pipeline.hpp"
#include "idl/interface/server_status.hpp"

namespace stillmap::server {

/// Percentiles over the last few hundred values.
class LatencyWindow {
 public:
  void add(double milliseconds);
  [[nodiscard]] dds::StageLatency summary(const std::string& stage) const;

 private:
  static constexpr std::size_t capacity_ = 512;
  std::vector<double> values_ms_;
  std::size_t next_ = 0;
};

/// Median of the last few values, which single outliers do not move.
class RecentMedian {
 public:
  explicit RecentMedian(std::size_t window) : window_(window) {}
  void add(double value);
  [[nodiscard]] std::size_t size() const { return last_.size(); }
  /// 0 before the first value.
  [[nodiscard]] double value() const;

 private:
  std::size_t window_;
  std::deque<double> last_;
};

/// Events a second over the last few seconds.
class RateWindow {
 public:
  using Clock = std::chrono::steady_clock;
  void add(Clock::time_point event);
  [[nodiscard]] double rate_hz(Clock::time_point now) const;

 private:
  std::deque<Clock::time_point> events_;
};

/// Where the labels of the last scans came from.
class LabelProvenanceWindow {
 public:
  void add(LabelProvenance label_provenance);
  /// 0 before the first.
  [[nodiscard]] double share(LabelProvenance label_provenance) const;

 private:
  std::deque<LabelProvenance> last_;
};

}  // namespace stillmap::server
