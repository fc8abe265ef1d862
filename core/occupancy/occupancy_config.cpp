#include "core/occupancy/occupancy_config.hpp"

namespace stillmap {
namespace {

std::string outside(const char* field, double value, double low, double high, const char* unit) {
  if (value >= low && value <= high) return {};
  std::string text = "occupancy.";
  text.append(field).append(" is ").append(std::to_string(value)).append("; it must be ");
  text.append(std::to_string(low)).append(" to ").append(std::to_string(high)).append(unit);
  return text.append("\n");
}

}  // namespace

std::string OccupancyConfig::faults() const {
  std::string text =
      outside("resolution_m", resolution_m, min_resolution_m, max_resolution_m, " m");
  text += outside("max_range_m", max_range_m, 1.0, 300.0, " m");
  text += outside("clearing_range_m", clearing_range_m, 0.0, 300.0, " m");
  text += outside("clearing_interval", clearing_interval, 1.0, 1000.0, "");
  text += outside("clearing_margin_m", clearing_margin_m, 0.0, 100.0, " m");
  text += outside("clearing_margin_share", clearing_margin_share, 0.0, 0.9, "");
  text += outside("hit_probability", hit_probability, 0.501, 0.99, "");
  text += outside("miss_probability", miss_probability, 0.01, 0.499, "");
  return text;
}

}  // namespace stillmap
