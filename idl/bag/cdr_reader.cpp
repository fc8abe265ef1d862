#include "idl/bag/cdr_reader.hpp"

namespace stillmap::dds {
namespace {

constexpr std::size_t encapsulation_bytes = 4;

}  // namespace

CdrReader::CdrReader(std::span<const std::uint8_t> message) {
  if (message.size() < encapsulation_bytes) {
    throw CdrError("it has " + std::to_string(message.size()) + " bytes, not even CDR's first 4");
  }
  // 0: big-endian, 1: little-endian; others are encodings that ROS 2 does not write.
  if (message[0] != 0 || message[1] > 1) {
    throw CdrError("it begins with " + std::to_string(message[0]) + " " +
                   std::to_string(message[1]) + " and not as plain CDR (0 0 or 0 1)");
  }
  const bool little = message[1] == 1;
  swap_bytes_ = little != (std::endian::native == std::endian::little);
  body_ = message.subspan(encapsulation_bytes);
}

void CdrReader::align(std::size_t bytes) { at_ += (bytes - at_ % bytes) % bytes; }

std::span<const std::uint8_t> CdrReader::take(std::size_t bytes) {
  if (at_ > body_.size() || bytes > body_.size() - at_) {
    throw CdrError("it is cut off: " + std::to_string(bytes) + " bytes are missing at byte " +
                   std::to_string(at_ + encapsulation_bytes) + " of " +
                   std::to_string(body_.size() + encapsulation_bytes));
  }
  const auto taken = body_.subspan(at_, bytes);
  at_ += bytes;
  return taken;
}

std::size_t CdrReader::count(std::size_t min_bytes_each) {
  const std::size_t elements = value<std::uint32_t>();
  const std::size_t left = at_ < body_.size() ? body_.size() - at_ : 0;
  if (elements > left / min_bytes_each) {
    throw CdrError("it is cut off: " + std::to_string(elements) +
                   " elements are announced at byte " + std::to_string(at_) + ", and " +
                   std::to_string(left) + " bytes are left");
  }
  return elements;
}

std::string CdrReader::text() {
  const std::size_t length = count(1);
  const auto characters = take(length);
  // The end is stored; a writer that leaves it out is understood too.
  const std::size_t shown = length > 0 && characters.back() == 0 ? length - 1 : length;
  return {reinterpret_cast<const char*>(characters.data()), shown};
}

std::span<const std::uint8_t> CdrReader::octets() { return take(count(1)); }

}  // namespace stillmap::dds
