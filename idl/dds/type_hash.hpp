#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace stillmap::dds {

/// The hash by which ROS 2 from Iron on tells definitions of a type apart (REP 2016), as
/// "RIHS01_df668c..."; `dds_type` is the name on the wire ("std_msgs::msg::dds_::Header_"). Empty
/// for a type that idl/msg does not define.
[[nodiscard]] std::string_view type_hash(std::string_view dds_type);

/// What ROS 2 writes into the user data of an endpoint of this type: "typehash=RIHS01_...;".
[[nodiscard]] std::string type_hash_user_data(std::string_view dds_type);

/// The hash in an endpoint's user data; empty where there is none. The data may be anything.
[[nodiscard]] std::string type_hash_in(std::string_view user_data);

}  // namespace stillmap::dds
