#pragma once

#include <cstring>
#include <optional>
#include <stdexcept>
#include <string>

#include "idl/dds/type_support.hpp"
#include "tests/fuzz/fuzz_target.hpp"

namespace stillmap::fuzz {

/// A message from the bytes of a DDS sample, read as the receiving side reads it; nothing where
/// that drops it.
template <typename Message>
[[nodiscard]] std::optional<Message> from_cdr(Bytes bytes) {
  static const eprosima::fastdds::dds::TypeSupport type = dds::type_support<Message>();
  eprosima::fastrtps::rtps::SerializedPayload_t payload(static_cast<std::uint32_t>(bytes.size()));
  if (!bytes.empty()) std::memcpy(payload.data, bytes.data(), bytes.size());
  payload.length = static_cast<std::uint32_t>(bytes.size());
  std::optional<Message> message(std::in_place);
  if (!type->deserialize(&payload, &*message)) message.reset();
  return message;
}

/// The bytes of a sample.
template <typename Message>
[[nodiscard]] std::string to_cdr(Message message) {
  const eprosima::fastdds::dds::TypeSupport type = dds::type_support<Message>();
  eprosima::fastrtps::rtps::SerializedPayload_t payload(
      type->getSerializedSizeProvider(&message)());
  if (!type->serialize(&message, &payload)) throw std::runtime_error("message too large");
  return {reinterpret_cast<const char*>(payload.data), payload.length};
}

}  // namespace stillmap::fuzz
