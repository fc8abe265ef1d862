#pragma once

#include <cstddef>
#include <string>
#include <vector>

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

}  // namespace stillmap::server
