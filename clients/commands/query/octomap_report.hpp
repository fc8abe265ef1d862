#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/occupancy/occupancy_query.hpp"
#include "core/occupancy/octomap_data.hpp"

namespace stillmap::cli {

/// What an octree holds.
struct OctomapSummary {
  double resolution_m = 0.0;
  std::uint64_t nodes = 0;
  std::uint64_t occupied = 0;
  std::uint64_t free = 0;
  std::uint64_t encoded_bytes = 0;
};

[[nodiscard]] OctomapSummary summarize(const OctomapData& data);

[[nodiscard]] std::string describe(const OctomapSummary& summary);
[[nodiscard]] nlohmann::json to_json(const OctomapSummary& summary);

/// Every question with its answer, a line each.
[[nodiscard]] std::string describe(const OccupancyQuery& query, const OccupancyAnswers& answers);
[[nodiscard]] nlohmann::json to_json(const OccupancyAnswers& answers);

}  // namespace stillmap::cli
