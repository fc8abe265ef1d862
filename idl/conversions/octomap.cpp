#include "idl/conversions/octomap.hpp"

#include "idl/conversions/header.hpp"

namespace stillmap::wire {

octomap_msgs::msg::Octomap to_octomap(const OctomapData& data, std::int64_t stamp_ns,
                                      const std::string& map_frame) {
  octomap_msgs::msg::Octomap message;
  message.header(to_header(stamp_ns, map_frame));
  message.binary(data.binary);
  message.id(OctomapData::tree_id);
  message.resolution(data.resolution_m);
  message.data().assign(data.bytes.begin(), data.bytes.end());
  return message;
}

std::optional<OctomapData> from_octomap(const octomap_msgs::msg::Octomap& message) {
  if (message.id() != OctomapData::tree_id || !(message.resolution() > 0.0)) return std::nullopt;
  return OctomapData{.binary = message.binary(),
                     .resolution_m = message.resolution(),
                     .bytes = {message.data().begin(), message.data().end()}};
}

}  // namespace stillmap::wire
