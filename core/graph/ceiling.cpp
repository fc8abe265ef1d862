#include "core/graph/ceiling.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace stillmap {
namespace {

constexpr auto cell_m = static_cast<float>(UprightImage::cell_m);
/// What is lower above the ground stands on it: no ceiling [m].
constexpr float ground_m = 0.5F;
constexpr float min_headroom_m = 1.8F;
/// A ceiling with its beams and pipes [m].
constexpr float max_thickness_m = 0.8F;
/// So many cells have one of the same height, up to `same_m`: this share of all, as a lidar that
/// hardly looks up sees some of it far away alone, and this share of those with anything thin
/// above: branches are at all heights.
constexpr std::size_t min_cells = 40;
constexpr double min_share = 0.04;
constexpr double min_flat_share = 0.5;
constexpr float same_m = 0.3F;

/// What is above the ground of a cell [m].
struct Column {
  bool is_blocked = false;
  float lowest_above_m = std::numeric_limits<float>::infinity();
  float highest_above_m = 0.0F;

  void add(float above_m) {
    if (above_m < ground_m) return;
    if (above_m < min_headroom_m) is_blocked = true;
    lowest_above_m = std::min(lowest_above_m, above_m);
    highest_above_m = std::max(highest_above_m, above_m);
  }
  [[nodiscard]] bool has_ceiling() const {
    return highest_above_m > 0.0F && highest_above_m - lowest_above_m <= max_thickness_m;
  }
};

std::vector<Column> columns_of(const PlacedSubmap& placed) {
  const UprightImage& image = placed.image;
  const auto width = static_cast<std::size_t>(image.columns());
  std::vector<Column> columns(width * static_cast<std::size_t>(image.rows()));
  for (const Eigen::Vector3f& p : placed.submap.points_submap) {
    const Eigen::Vector2f place = (p.head<2>() - image.corner_submap()) / cell_m;
    const auto column = static_cast<std::size_t>(place.x());
    const auto row = static_cast<std::size_t>(place.y());
    if (const auto lowest = image.lowest_at(p.head<2>()))
      columns[row * width + column].add(p.z() - *lowest);
  }
  return columns;
}

}  // namespace

std::optional<double> ceiling_height_m(const PlacedSubmap& lower, const PlacedSubmap& upper,
                                       const Eigen::Isometry2d& T_upper_lower) {
  const std::vector<Column> columns = columns_of(lower);
  const Eigen::Isometry2f T = T_upper_lower.cast<float>();
  std::vector<float> heights_m;
  std::size_t seen = 0;
  for (const Eigen::Vector3f& ground : lower.image.lowest_points()) {
    if (!upper.image.lowest_at(T * Eigen::Vector2f(ground.head<2>()))) continue;
    const Eigen::Vector2f place = (ground.head<2>() - lower.image.corner_submap()) / cell_m;
    const Column& column = columns[static_cast<std::size_t>(place.y()) *
                                       static_cast<std::size_t>(lower.image.columns()) +
                                   static_cast<std::size_t>(place.x())];
    if (column.is_blocked) continue;
    ++seen;
    if (column.has_ceiling()) heights_m.push_back(column.lowest_above_m);
  }
  if (heights_m.empty()) return std::nullopt;
  const auto middle = heights_m.begin() + static_cast<std::ptrdiff_t>(heights_m.size() / 2);
  std::ranges::nth_element(heights_m, middle);
  const float height_m = *middle;
  const auto same = static_cast<std::size_t>(std::ranges::count_if(
      heights_m, [height_m](float other_m) { return std::abs(other_m - height_m) <= same_m; }));
  const bool is_ceiling =
      same >= min_cells && static_cast<double>(same) >= min_share * static_cast<double>(seen) &&
      static_cast<double>(same) >= min_flat_share * static_cast<double>(heights_m.size());
  return is_ceiling ? std::optional<double>(height_m) : std::nullopt;
}

}  // namespace stillmap
