#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/map/submap_list.hpp"

namespace stillmap_msgs::msg {
class SubmapList;
}

namespace stillmap {

/// The submaps of a server's map.
struct SubmapsOfMap {
  std::uint64_t map_id = 0;
  /// The map's, as "map", and the one whose poses stand for the submaps, as "base_link".
  std::string frame;
  std::string child_frame;
  SubmapList list;
};

namespace wire {

[[nodiscard]] stillmap_msgs::msg::SubmapList to_wire(const SubmapsOfMap& submaps);
/// Nothing for another format, poses or stamps that cannot be used, and loops between submaps that
/// are not there.
[[nodiscard]] std::optional<SubmapsOfMap> from_wire(const stillmap_msgs::msg::SubmapList& message);

}  // namespace wire
}  // namespace stillmap
