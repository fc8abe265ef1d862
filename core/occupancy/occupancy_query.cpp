#include "core/occupancy/occupancy_query.hpp"

namespace stillmap {
namespace {

std::string too_many(const char* what, std::size_t asked, std::size_t most) {
  if (asked <= most) return {};
  std::string text = std::to_string(asked);
  text.append(" ").append(what).append(" are more than the ").append(std::to_string(most));
  return text.append(" of one request; ask several times\n");
}

}  // namespace

std::string OccupancyQuery::faults() const {
  return too_many("points", points_map.size(), max_points) +
         too_many("boxes", boxes_map.size(), max_boxes) + too_many("rays", rays.size(), max_rays) +
         too_many("voxels (max_voxels)", max_voxels, max_listed_voxels);
}

}  // namespace stillmap
