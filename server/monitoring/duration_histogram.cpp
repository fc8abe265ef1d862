#include "server/monitoring/duration_histogram.hpp"

namespace stillmap::server {

void DurationHistogram::add(double seconds) {
  ++count_;
  sum_s_ += seconds;
  for (std::size_t i = 0; i < bounds_s.size(); ++i) {
    if (seconds <= bounds_s.at(i)) ++up_to_.at(i);
  }
}

}  // namespace stillmap::server
