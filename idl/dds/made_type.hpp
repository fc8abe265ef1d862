#pragma once

#include <fastcdr/exceptions/Exception.h>

#include <fastdds/dds/topic/TypeSupport.hpp>
#include <memory>

namespace stillmap {

/// A generated PubSubType that survives every sample: generated code lets the faults of an unknown
/// encapsulation or of a boolean that is neither 0 nor 1 through, out of the thread that reads.
template <typename PubSubType>
class Guarded : public PubSubType {
 public:
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* sample) override {
    try {
      return PubSubType::deserialize(payload, sample);
    } catch (const eprosima::fastcdr::exception::Exception&) {
      return false;
    }
  }
};

/// Of a generated PubSubType. TypeSupport takes ownership of the pointer.
template <typename PubSubType>
[[nodiscard]] eprosima::fastdds::dds::TypeSupport make() {
  return eprosima::fastdds::dds::TypeSupport(std::make_unique<Guarded<PubSubType>>().release());
}

}  // namespace stillmap
