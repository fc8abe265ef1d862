#include "idl/dds/shown_text.hpp"

#include <algorithm>
#include <iterator>

namespace stillmap::dds {
namespace {

/// Of the character at the front (Unicode, table 3-7); 0 where none is.
std::size_t utf8_bytes(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const auto follows = [&](std::size_t i) { return (byte(i) & 0xC0U) == 0x80U; };
  const unsigned first = byte(0);
  const unsigned second = byte(1);
  if (first < 0x80U) return 1;
  if (first < 0xC2U || first > 0xF4U || !follows(1)) return 0;
  if (first < 0xE0U) return 2;
  // Neither what fits into fewer bytes nor a surrogate.
  if ((first == 0xE0U && second < 0xA0U) || (first == 0xEDU && second > 0x9FU)) return 0;
  if (first < 0xF0U) return follows(2) ? 3 : 0;
  // Nor what is beyond the last character.
  if ((first == 0xF0U && second < 0x90U) || (first == 0xF4U && second > 0x8FU)) return 0;
  return follows(2) && follows(3) ? 4 : 0;
}

/// Of Unicode's Bidi_Control: they turn the order in which what follows is shown.
bool is_turn(std::string_view character) {
  constexpr std::string_view turns[] = {"\u061C", "\u200E", "\u200F", "\u202A", "\u202B", "\u202C",
                                        "\u202D", "\u202E", "\u2066", "\u2067", "\u2068", "\u2069"};
  return std::ranges::find(turns, character) != std::end(turns);
}

/// U+0000 to U+001F, U+007F to U+009F, and those that end a line or a paragraph.
bool is_control(std::string_view character) {
  const auto first = static_cast<unsigned char>(character.front());
  const auto last = static_cast<unsigned char>(character.back());
  if (character.size() == 1) return first < 0x20 || first == 0x7F;
  if (character.size() == 2) return first == 0xC2 && last < 0xA0;
  return character == "\u2028" || character == "\u2029";
}

}  // namespace

std::string shown_text(std::string_view text, std::size_t max_bytes) {
  std::string shown;
  while (!text.empty()) {
    const std::size_t bytes = utf8_bytes(text);
    const std::string_view character = text.substr(0, bytes);
    const bool is_shown = bytes > 0 && !is_control(character) && !is_turn(character);
    const std::string_view next = is_shown ? character : std::string_view("?");
    if (shown.size() + next.size() > max_bytes) return shown.append("...");
    shown.append(next);
    text.remove_prefix(std::max<std::size_t>(bytes, 1));
  }
  return shown;
}

}  // namespace stillmap::dds
