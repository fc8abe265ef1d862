#include "core/dataset/file_stamp.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

namespace stillmap {
namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;
/// Whole seconds that fit into 64 bits of nanoseconds.
constexpr std::size_t max_digits_of_seconds = 10;
constexpr double max_seconds = 9.2e9;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// Length of the digits at the front of the text.
std::size_t digits_in_front(std::string_view text) {
  return static_cast<std::size_t>(std::ranges::find_if_not(text, is_digit) - text.begin());
}

/// Value of up to 18 digits.
std::int64_t value_of(std::string_view digits) {
  std::int64_t value = 0;
  for (const char digit : digits) value = 10 * value + (digit - '0');
  return value;
}

std::optional<std::int64_t> from_floating_point(std::string_view text) {
  double seconds = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seconds);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if (!(std::abs(seconds) < max_seconds)) return std::nullopt;
  return std::llround(seconds * static_cast<double>(ns_per_s));
}

/// "1583836591_182590976": seconds and nanoseconds since 1970.
std::optional<std::int64_t> two_numbers(std::string_view text) {
  constexpr std::size_t digits_of_nanoseconds = 9;
  const std::size_t whole = digits_in_front(text);
  if (whole != max_digits_of_seconds || whole + 1 >= text.size() || text[whole] != '_') {
    return std::nullopt;
  }
  // A counter with zeros in front; seconds have ten digits since 2001.
  if (text.front() == '0') return std::nullopt;
  const std::string_view fraction = text.substr(whole + 1);
  // Others than nine: nobody knows whether zeros are missing in front or behind.
  const bool is_whole = digits_in_front(fraction) == fraction.size();
  if (!is_whole || fraction.size() != digits_of_nanoseconds) return std::nullopt;
  const std::int64_t seconds = value_of(text.substr(0, whole));
  if (static_cast<double>(seconds) >= max_seconds) return std::nullopt;
  return seconds * ns_per_s + value_of(fraction);
}

}  // namespace

std::optional<std::int64_t> ns_from_seconds(std::string_view text) {
  const bool negative = text.starts_with('-');
  const std::string_view number = text.substr(negative ? 1 : 0);
  const std::size_t whole = digits_in_front(number);
  std::string_view decimals = number.substr(whole);
  if (decimals.starts_with('.')) decimals.remove_prefix(1);
  if (whole == 0 || whole > max_digits_of_seconds || digits_in_front(decimals) < decimals.size()) {
    return from_floating_point(text);
  }
  const std::int64_t seconds = value_of(number.substr(0, whole));
  if (static_cast<double>(seconds) >= max_seconds) return std::nullopt;
  std::int64_t fraction_ns = 0;
  for (std::size_t i = 0; i < 9; ++i) {
    fraction_ns = 10 * fraction_ns + (i < decimals.size() ? decimals[i] - '0' : 0);
  }
  const std::int64_t ns = seconds * ns_per_s + fraction_ns;
  return negative ? -ns : ns;
}

namespace {

/// Of a name that is nothing but a stamp.
std::optional<std::int64_t> stamp_ns_of(std::string_view text) {
  const std::size_t whole = digits_in_front(text);
  if (whole == 0) return std::nullopt;
  if (whole < text.size()) {
    const bool decimals_follow = text[whole] == '.' && whole + 1 < text.size() &&
                                 digits_in_front(text.substr(whole + 1)) == text.size() - whole - 1;
    if (text[whole] == '_') return two_numbers(text);
    return decimals_follow ? ns_from_seconds(text) : std::nullopt;
  }
  // What comes later does not fit into 64 bits.
  constexpr std::string_view latest = "9200000000000000000";
  if (text >= latest.substr(0, whole)) return std::nullopt;
  if (whole == 13 && text.front() != '0') return value_of(text) * 1'000'000;
  if (whole == 16) return value_of(text) * 1000;
  if (whole == 19) {
    return value_of(text.substr(0, 10)) * ns_per_s + value_of(text.substr(10));
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::int64_t> stamp_ns_from_name(std::string_view stem) {
  if (stem.ends_with(".pcd")) stem.remove_suffix(4);
  if (const auto stamp_ns = stamp_ns_of(stem)) return stamp_ns;
  // Behind the words of the name: seconds and nanoseconds have a "_" of their own.
  const std::size_t last = stem.rfind('_');
  if (last == std::string_view::npos || last == 0) return std::nullopt;
  const std::size_t second = stem.rfind('_', last - 1);
  if (second != std::string_view::npos) {
    if (const auto stamp_ns = two_numbers(stem.substr(second + 1))) return stamp_ns;
  }
  // A number of words is their own, but one that can only be a time.
  const std::string_view number = stem.substr(last + 1);
  return digits_in_front(number) == number.size() ? stamp_ns_of(number) : std::nullopt;
}

bool natural_less(std::string_view a, std::string_view b) {
  const std::string_view whole_a = a, whole_b = b;
  while (!a.empty() && !b.empty()) {
    std::size_t digits_a = digits_in_front(a), digits_b = digits_in_front(b);
    if (digits_a == 0 || digits_b == 0) {
      if (a.front() != b.front()) return a.front() < b.front();
      a.remove_prefix(1);
      b.remove_prefix(1);
      continue;
    }
    const auto zeros = [](std::string_view text, std::size_t digits) {
      return std::min(text.find_first_not_of('0'), digits);
    };
    std::string_view number_a = a.substr(zeros(a, digits_a), digits_a - zeros(a, digits_a));
    std::string_view number_b = b.substr(zeros(b, digits_b), digits_b - zeros(b, digits_b));
    if (number_a.size() != number_b.size()) return number_a.size() < number_b.size();
    if (number_a != number_b) return number_a < number_b;
    a.remove_prefix(digits_a);
    b.remove_prefix(digits_b);
  }
  // Equal but for leading zeros: any fixed order will do.
  if (a.empty() && b.empty()) return whole_a < whole_b;
  return a.empty();
}

}  // namespace stillmap
