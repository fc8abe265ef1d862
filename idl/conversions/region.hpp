#pragma once

#include <optional>
#include <string>

#include "core/map/query/region.hpp"
#include "stillmap_msgs.h"

namespace stillmap::wire {

[[nodiscard]] stillmap_msgs::msg::Region to_wire(const Region& region);

/// Either a region or what is wrong with the message. Whether the region makes sense is for
/// region_faults to say.
struct RegionFromWire {
  std::optional<Region> region;
  std::string fault;
};
[[nodiscard]] RegionFromWire from_wire(const stillmap_msgs::msg::Region& message);

}  // namespace stillmap::wire
