#include "core/map/query/continuation.hpp"

#include <xxhash.h>

#include <array>
#include <charconv>

namespace stillmap {
namespace {

constexpr std::size_t word_digits = 16;
constexpr std::size_t word_count = 6;
using Words = std::array<std::uint64_t, word_count>;

std::uint64_t checksum(const Words& words) { return XXH3_64bits(words.data(), sizeof(words)); }

void append_word(std::string& token, std::uint64_t word) {
  std::array<char, word_digits> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), word, 16).ptr;
  const auto length = static_cast<std::size_t>(end - digits.data());
  token.append(word_digits - length, '0').append(digits.data(), length);
}

std::optional<std::uint64_t> parse_word(const std::string& token, std::size_t index) {
  const char* begin = token.data() + index * word_digits;
  std::uint64_t word = 0;
  const auto [end, error] = std::from_chars(begin, begin + word_digits, word, 16);
  if (error != std::errc{} || end != begin + word_digits) return std::nullopt;
  return word;
}

}  // namespace

std::string to_token(const Continuation& c) {
  const Words words{c.map_id, c.map_version, c.query_fingerprint, c.total_voxels, c.tile, c.voxel};
  std::string token;
  for (const std::uint64_t word : words) append_word(token, word);
  append_word(token, checksum(words));
  return token;
}

std::optional<Continuation> from_token(const std::string& token) {
  if (token.size() != (word_count + 1) * word_digits) return std::nullopt;
  Words words{};
  for (std::size_t i = 0; i < words.size(); ++i) {
    const auto word = parse_word(token, i);
    if (!word) return std::nullopt;
    words.at(i) = *word;
  }
  if (parse_word(token, word_count) != checksum(words)) return std::nullopt;
  return Continuation{words[0], words[1], words[2], words[3], words[4], words[5]};
}

}  // namespace stillmap
