#pragma once

#include <fastdds/dds/topic/TypeSupport.hpp>

namespace stillmap {

/// Makes the fields of stillmap_msgs/TileInfo known in this process, for content filters: readers
/// that filter need it, and so do writers, who then do not even send what a reader does not want.
void describe_tile_info(eprosima::fastdds::dds::TypeSupport& type);

}  // namespace stillmap
