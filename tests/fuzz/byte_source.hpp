#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "tests/fuzz/fuzz_target.hpp"

namespace stillmap::fuzz {

/// Takes values from the front of an input; zeros once it has ended.
class ByteSource {
 public:
  explicit ByteSource(Bytes bytes) : bytes_(bytes) {}

  template <typename T>
  requires std::is_trivially_copyable_v<T>
  [[nodiscard]] T value() {
    T value{};
    const Bytes from = take(sizeof(T));
    if (!from.empty()) std::memcpy(&value, from.data(), from.size());
    return value;
  }
  [[nodiscard]] std::uint8_t byte() { return value<std::uint8_t>(); }

  /// As many as there are, at most `count`.
  [[nodiscard]] Bytes take(std::size_t count) {
    const Bytes taken = bytes_.first(std::min(count, bytes_.size()));
    bytes_ = bytes_.subspan(taken.size());
    return taken;
  }
  [[nodiscard]] Bytes rest() { return take(bytes_.size()); }
  [[nodiscard]] bool empty() const { return bytes_.empty(); }

 private:
  Bytes bytes_;
};

[[nodiscard]] inline std::string text_of(Bytes bytes) { return {bytes.begin(), bytes.end()}; }

[[nodiscard]] inline std::vector<std::uint8_t> bytes_of(Bytes bytes) {
  return {bytes.begin(), bytes.end()};
}

/// Appends a value as ByteSource reads it.
template <typename T>
requires std::is_trivially_copyable_v<T>
void append_value(std::string& bytes, const T& value) {
  const std::size_t end = bytes.size();
  bytes.resize(end + sizeof(T));
  std::memcpy(bytes.data() + end, &value, sizeof(T));
}

/// The bytes with a number before them that says how they are to be read.
[[nodiscard]] inline std::string with_choice(std::uint8_t choice, const std::string& bytes) {
  std::string chosen(1, static_cast<char>(choice));
  return chosen.append(bytes);
}

}  // namespace stillmap::fuzz
