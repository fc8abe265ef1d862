#include "config/loaders/closest_name.hpp"

#include <algorithm>
#include <numeric>
#include <vector>

namespace stillmap {
namespace {

/// Levenshtein's distance: letters to insert, delete or replace.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

std::string closest_name(std::string_view written, std::span<const std::string> known) {
  constexpr std::size_t max_name_length = 64;
  if (written.size() > max_name_length) return {};
  std::string closest;
  std::size_t best = written.size() / 3 + 2;
  for (const std::string& name : known) {
    const bool unit_missing = name.starts_with(std::string(written) + '_');
    const std::size_t distance = unit_missing ? 1 : edit_distance(written, name);
    if (distance >= best) continue;
    best = distance;
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
