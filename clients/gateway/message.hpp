#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "idl/dds/serialized_sample.hpp"

namespace stillmap::gateway {

/// A sample as it came from DDS, shared by all clients that it is for.
struct Message {
  /// When this process took it, Unix epoch.
  std::int64_t received_ns = 0;
  /// Which older message it replaces where it waits: that with the same key.
  std::string key;
  dds::SerializedSample bytes;
};

using MessagePtr = std::shared_ptr<const Message>;

}  // namespace stillmap::gateway
