#include "idl/dds/ros_gids.hpp"

#include "idl/dds/type_hash.hpp"

namespace stillmap::dds {

std::optional<RosGids> gids_read_by(const Endpoint& endpoint) {
  if (endpoint.is_writer || endpoint.topic != ros_discovery_topic) return std::nullopt;
  if (endpoint.user_data == any_gids_user_data) return RosGids::any;
  return type_hash_in(endpoint.user_data).empty() ? RosGids::of_24_bytes : RosGids::of_16_bytes;
}

}  // namespace stillmap::dds
