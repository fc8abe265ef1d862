#include "core/graph/ceiling.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
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

/// So near to the key of a submap its lidar came by [m].
constexpr float near_key_m = 10.0F;
/// So many points that are so much higher than a ceiling, and so near to the key, tell that the
/// lidar looks up far enough to see that [m].
constexpr std::size_t min_higher = 50;
constexpr float higher_m = 0.3F;
constexpr float higher_within_m = 25.0F;
/// Of the cells under the ceiling, those that the lidar saw without it: of one that looks up a
/// little, and drove under it, it shows some.
constexpr double min_lacking_share = 0.95;

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

/// Of the point's cell, which the image has.
std::size_t index_of(const UprightImage& image, const Eigen::Vector3f& p) {
  const Eigen::Vector2f place = (p.head<2>() - image.corner_submap()) / cell_m;
  return static_cast<std::size_t>(place.y()) * static_cast<std::size_t>(image.columns()) +
         static_cast<std::size_t>(place.x());
}

std::vector<Column> columns_of(const PlacedSubmap& placed) {
  const UprightImage& image = placed.image;
  const auto width = static_cast<std::size_t>(image.columns());
  std::vector<Column> columns(width * static_cast<std::size_t>(image.rows()));
  for (const Eigen::Vector3f& p : placed.submap.points_submap)
    if (const auto lowest = image.lowest_at(p.head<2>()))
      columns[index_of(image, p)].add(p.z() - *lowest);
  return columns;
}

/// How high most of these are; nothing where less than `min_flat_share` and `min_cells` are.
std::optional<float> one_height_m(std::vector<float> heights_m) {
  if (heights_m.size() < min_cells) return std::nullopt;
  const auto middle = heights_m.begin() + static_cast<std::ptrdiff_t>(heights_m.size() / 2);
  std::ranges::nth_element(heights_m, middle);
  const float height_m = *middle;
  const auto same = static_cast<std::size_t>(std::ranges::count_if(
      heights_m, [height_m](float other_m) { return std::abs(other_m - height_m) <= same_m; }));
  const bool is_flat =
      same >= min_cells &&
      static_cast<double>(same) >= min_flat_share * static_cast<double>(heights_m.size());
  return is_flat ? std::optional<float>(height_m) : std::nullopt;
}

/// Points within this distance across of a place, in a frame of which they are moved by T.
Submap near_to(const Submap& submap, const Eigen::Isometry3f& T, const Eigen::Vector2f& place,
               float distance_m) {
  Submap near;
  for (const Eigen::Vector3f& p : submap.points_submap) {
    const Eigen::Vector3f moved = T * p;
    if ((moved.head<2>() - place).norm() <= distance_m) near.points_submap.push_back(moved);
  }
  near.classes.assign(near.points_submap.size(), SemanticClass::unlabeled);
  return near;
}

/// What the driver saw of a cell of the other submap.
struct Seen {
  bool ground = false;
  bool above = false;
};

}  // namespace

std::optional<double> ceiling_height_m(const PlacedSubmap& lower, const PlacedSubmap& upper,
                                       const Eigen::Isometry2d& T_upper_lower) {
  const std::vector<Column> columns = columns_of(lower);
  const Eigen::Isometry2f T = T_upper_lower.cast<float>();
  std::vector<float> heights_m;
  std::size_t seen = 0;
  for (const Eigen::Vector3f& ground : lower.image.lowest_points()) {
    if (!upper.image.lowest_at(T * Eigen::Vector2f(ground.head<2>()))) continue;
    const Column& column = columns[index_of(lower.image, ground)];
    if (column.is_blocked) continue;
    ++seen;
    if (column.has_ceiling()) heights_m.push_back(column.lowest_above_m);
  }
  if (static_cast<double>(heights_m.size()) < min_share * static_cast<double>(seen))
    return std::nullopt;
  return one_height_m(std::move(heights_m));
}

bool lacks_ceiling(const Submap& driver, const Submap& other,
                   const Eigen::Isometry3d& T_other_driver) {
  const Eigen::Isometry3f T = T_other_driver.cast<float>();
  const Eigen::Vector2f key = T.translation().head<2>();
  const PlacedSubmap roofed(near_to(other, Eigen::Isometry3f::Identity(), key, near_key_m));
  const std::vector<Column> columns = columns_of(roofed);
  const Submap own = near_to(driver, T, key, higher_within_m);
  std::vector<Seen> seen(columns.size());
  for (const Eigen::Vector3f& p : own.points_submap) {
    const auto lowest = roofed.image.lowest_at(p.head<2>());
    if (!lowest) continue;
    Seen& here = seen[index_of(roofed.image, p)];
    here.ground |= std::abs(p.z() - *lowest) < ground_m;
    here.above |= p.z() - *lowest >= min_headroom_m;
  }
  std::vector<float> heights_m;
  std::size_t lacking = 0;
  float highest_m = std::numeric_limits<float>::lowest();
  for (const Eigen::Vector3f& ground : roofed.image.lowest_points()) {
    const std::size_t i = index_of(roofed.image, ground);
    if (columns[i].is_blocked || !columns[i].has_ceiling() || !seen[i].ground) continue;
    heights_m.push_back(columns[i].lowest_above_m);
    highest_m = std::max(highest_m, ground.z() + columns[i].lowest_above_m);
    if (!seen[i].above) ++lacking;
  }
  const std::size_t roofed_cells = heights_m.size();
  if (!one_height_m(std::move(heights_m)) ||
      static_cast<double>(lacking) < min_lacking_share * static_cast<double>(roofed_cells))
    return false;
  const auto higher = static_cast<std::size_t>(std::ranges::count_if(
      own.points_submap,
      [highest_m](const Eigen::Vector3f& p) { return p.z() > highest_m + higher_m; }));
  return higher >= min_higher;
}

}  // namespace stillmap
