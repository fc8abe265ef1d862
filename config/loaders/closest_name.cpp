#include "config/loaders/closest_name.hpp"

#include <algorithm>
#include <numeric>
#include <utility>
#include <vector>

namespace stillmap {
namespace {

/// Letters to change, add, leave out, or swap with the next between two words (Damerau).
std::size_t edits_between(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1);
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::vector<std::size_t> next(b.size() + 1, i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = row[j] + (a[i] == b[j] ? 0 : 1);
      next[j + 1] = std::min({changed, next[j] + 1, row[j + 1] + 1});
      if (i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j])
        next[j + 1] = std::min(next[j + 1], before[j - 1] + 1);
    }
    before = std::exchange(row, std::move(next));
  }
  return row.back();
}

}  // namespace

std::string closest_name(std::string_view written, std::span<const std::string> known) {
  constexpr std::size_t max_name_length = 64;
  if (written.size() > max_name_length) return {};
  std::string closest;
  // Another word of three or four letters is often two edits away.
  constexpr std::size_t short_word = 4;
  std::size_t best = written.size() <= short_word ? 2 : written.size() / 3 + 2;
  for (const std::string& name : known) {
    const bool unit_missing = name.starts_with(std::string(written) + '_');
    const std::size_t edits = unit_missing ? 1 : edits_between(written, name);
    if (edits >= best) continue;
    best = edits;
    closest = name;
  }
  return closest;
}

std::string did_you_mean(std::string_view written, std::span<const std::string> known) {
  const std::string closest = closest_name(written, known);
  if (!closest.empty()) return "; did you mean '" + closest + "'?";
  std::string list;
  for (const std::string& name : known) list += (list.empty() ? "" : ", ") + name;
  return "; known are: " + list;
}

}  // namespace stillmap
