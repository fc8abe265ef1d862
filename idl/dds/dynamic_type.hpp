#pragma once

#include <fastdds/dds/topic/TypeSupport.hpp>

namespace stillmap::dds {

/// Makes the fields of stillmap_msgs/TileInfo known in this process, for content filters: readers
/// that filter need it, and so do writers, who then do not even send what a reader does not want.
void register_tile_info_type(eprosima::fastdds::dds::TypeSupport& type);

}  // namespace stillmap::dds
