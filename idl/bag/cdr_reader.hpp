#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>

namespace stillmap::dds {

/// Bytes that are no message of the expected type.
class CdrError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reads a serialized message (OMG CDR, XCDR1) of either byte order, as DDS sends and rosbag2
/// stores it: four bytes of encapsulation, then values aligned to their size. Believes no length
/// before it has seen that the bytes are there. All throw CdrError.
class CdrReader {
 public:
  /// The bytes must outlive the reader.
  explicit CdrReader(std::span<const std::uint8_t> message);

  template <typename T>
  [[nodiscard]] T value() {
    align(sizeof(T));
    return load<T>(take(sizeof(T)));
  }
  [[nodiscard]] std::string text();
  /// A sequence's length, checked to have room for elements of at least so many bytes.
  [[nodiscard]] std::size_t count(std::size_t min_bytes_each);
  /// A sequence of octets, in place.
  [[nodiscard]] std::span<const std::uint8_t> octets();
  /// An array of octets, in place.
  [[nodiscard]] std::span<const std::uint8_t> take(std::size_t bytes);

 private:
  template <typename T>
  [[nodiscard]] T load(std::span<const std::uint8_t> bytes) const {
    std::uint8_t ordered[sizeof(T)];
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      ordered[i] = bytes[swap_bytes_ ? sizeof(T) - 1 - i : i];
    }
    T value;
    std::memcpy(&value, ordered, sizeof value);
    return value;
  }
  void align(std::size_t bytes);

  std::span<const std::uint8_t> body_;
  std::size_t at_ = 0;
  bool swap_bytes_ = false;
};

}  // namespace stillmap::dds
