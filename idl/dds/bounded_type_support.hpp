#pragma once

#include <exception>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <memory>

namespace stillmap::dds {

/// A generated type that anybody may send bytes for. Generated code lets all exceptions but one
/// out, and Fast DDS does not catch them either: a sample of an unknown encapsulation, or with a
/// boolean that is neither 0 nor 1, would end the program that reads it.
template <typename PubSubType>
class BoundedTypeSupport final : public PubSubType {
 public:
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    try {
      return PubSubType::deserialize(payload, data);
    } catch (const std::exception&) {
      return false;
    }
  }
};

/// Of a generated PubSubType. TypeSupport takes ownership of the pointer.
template <typename PubSubType>
[[nodiscard]] eprosima::fastdds::dds::TypeSupport make_bounded_type_support() {
  return eprosima::fastdds::dds::TypeSupport(
      std::make_unique<BoundedTypeSupport<PubSubType>>().release());
}

}  // namespace stillmap::dds
