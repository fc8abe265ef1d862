#pragma once

#include <cstddef>
#include <deque>

namespace stillmap::server {

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

}  // namespace stillmap::server
