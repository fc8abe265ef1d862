#include "idl/interface/server_status.hpp"

#include <algorithm>
#include <numeric>

namespace stillmap::dds {

std::string every_nth_scan(std::uint32_t n) {
  if (n <= 1) return "every scan";
  const bool teen = n % 100 / 10 == 1;
  const char* ending = "th";
  if (!teen && n % 10 == 1) ending = "st";
  if (!teen && n % 10 == 2) ending = "nd";
  if (!teen && n % 10 == 3) ending = "rd";
  return "every " + std::to_string(n).append(ending).append(" scan");
}

std::uint64_t ServerStatus::counter(std::string_view name, std::string_view detail) const {
  const auto found = std::ranges::find_if(counters, [&](const NamedCounter& counter) {
    return counter.name == name && counter.detail == detail;
  });
  return found == counters.end() ? 0 : found->value;
}

std::uint64_t ServerStatus::dropped() const {
  return std::accumulate(counters.begin(), counters.end(), std::uint64_t{0},
                         [](std::uint64_t sum, const NamedCounter& counter) {
                           return counter.name == scans_dropped_counter ? sum + counter.value : sum;
                         });
}

std::uint64_t ServerStatus::dropped(std::string_view reason) const {
  return counter(scans_dropped_counter, reason);
}

}  // namespace stillmap::dds
