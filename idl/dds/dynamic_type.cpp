#include "idl/dds/dynamic_type.hpp"

#include <fastrtps/types/TypeObjectFactory.h>

#include "tile_indexTypeObject.h"

namespace stillmap::dds {

void register_tile_info_type(eprosima::fastdds::dds::TypeSupport& type) {
  auto* const factory = eprosima::fastrtps::types::TypeObjectFactory::get_instance();
  for (const bool is_complete : {true, false}) {
    // Filters look for the name that the type has on the wire; generated code uses another one.
    factory->add_type_object(type.get_type_name(),
                             stillmap_msgs::msg::GetTileInfoIdentifier(is_complete),
                             stillmap_msgs::msg::GetTileInfoObject(is_complete));
  }
  // It is for this process only: in discovery, it would make other vendors compare types.
  type->auto_fill_type_object(false);
  type->auto_fill_type_information(false);
}

}  // namespace stillmap::dds
