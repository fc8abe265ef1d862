#pragma once

#include <fastdds/dds/topic/TypeSupport.hpp>

namespace stillmap::dds {

/// What Fast DDS needs to carry a generated type T. Exists for every type of idl/msg that is a
/// topic; another one does not link.
template <typename T>
[[nodiscard]] eprosima::fastdds::dds::TypeSupport type_support();

}  // namespace stillmap::dds
