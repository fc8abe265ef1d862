#pragma once

#include <fastdds/dds/topic/TypeSupport.hpp>
#include <memory>

namespace stillmap {

/// Of a generated PubSubType. TypeSupport takes ownership of the pointer.
template <typename PubSubType>
[[nodiscard]] eprosima::fastdds::dds::TypeSupport make() {
  return eprosima::fastdds::dds::TypeSupport(std::make_unique<PubSubType>().release());
}

}  // namespace stillmap
