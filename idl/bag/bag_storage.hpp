#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace stillmap::dds {

/// The file of a bag that is being written. All throw DatasetError.
class BagStorage {
 public:
  BagStorage() = default;
  virtual ~BagStorage() = default;
  BagStorage(const BagStorage&) = delete;
  BagStorage& operator=(const BagStorage&) = delete;

  /// A serialized message with its encapsulation, of topic number `topic`.
  virtual void add(std::size_t topic, std::int64_t received_ns,
                   std::span<const std::uint8_t> message) = 0;
  /// Hands all that was added to the operating system: it survives the end of the process.
  virtual void commit() = 0;
  /// Leaves a whole file; nothing is called after it.
  virtual void finish() = 0;
};

}  // namespace stillmap::dds
