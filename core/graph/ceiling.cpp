#include "core/graph/ceiling.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

constexpr auto cell_m = static_cast<float>(UprightImage::cell_m);
/// What is lower above the ground stands on it: no ceiling [m].
constexpr float ground_m = 0.5F;
constexpr float min_headroom_m = 1.8F;
/// A ceiling with its beams and pipes [m].
constexpr float max_thickness_m = 0.8F;
/// So many cells have one, this share of all, as a lidar that hardly looks up sees some of it far
/// away alone; and this share of those with anything thin above is of one height, up to `same_m`:
/// branches are at all heights, also where a lidar sees no more than a metre of a crown.
constexpr std::size_t min_cells = 40;
constexpr double min_share = 0.01;
constexpr double min_flat_share = 0.65;
constexpr float same_m = 0.15F;

/// So near to the key of a submap its lidar came by, and so far along x it may have been [m].
constexpr float near_key_m = 10.0F;
constexpr float half_way_m = 0.5F * static_cast<float>(SubmapConfig{}.length_m);
/// So many points within this distance of the key tell how steeply the lidar looks up. A ceiling
/// this much above its lowest point is seen by it [m].
constexpr std::size_t min_higher = 50;
constexpr float higher_within_m = 25.0F;
constexpr float margin_m = 0.3F;
/// Of the cells of which the driver saw the ground, those under the ceiling: an awning is over few.
constexpr double min_roofed_share = 0.2;
/// Of the cells whose ceiling the lidar must have seen, those that it saw without.
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
  const float height_m = median_of(heights_m);
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

std::vector<Seen> seen_of(const PlacedSubmap& roofed, const Submap& own) {
  std::vector<Seen> seen(static_cast<std::size_t>(roofed.image.columns()) *
                         static_cast<std::size_t>(roofed.image.rows()));
  for (const Eigen::Vector3f& p : own.points_submap) {
    const auto lowest = roofed.image.lowest_at(p.head<2>());
    if (!lowest) continue;
    Seen& here = seen[index_of(roofed.image, p)];
    here.ground |= std::abs(p.z() - *lowest) < ground_m;
    here.above |= p.z() - *lowest >= min_headroom_m;
  }
  return seen;
}

/// How steeply a lidar looks up at least that came along x of the key's frame, or near it.
class UpwardView {
 public:
  /// Points, and the key, in one frame.
  UpwardView(const Submap& own, const Eigen::Isometry3f& T_own_key)
      : T_key_own_(T_own_key.inverse()) {
    if (own.points_submap.size() < min_higher) return;
    std::vector<float> rises;
    rises.reserve(own.points_submap.size());
    for (const Eigen::Vector3f& p : own.points_submap) rises.push_back(rise_of(T_key_own_ * p));
    const auto last = rises.begin() + static_cast<std::ptrdiff_t>(min_higher - 1);
    std::ranges::nth_element(rises, last, std::greater<>());
    rise_ = *last;
  }

  /// Whether it must have seen this point from somewhere on its way.
  [[nodiscard]] bool reaches(const Eigen::Vector3f& p) const {
    return rise_of(T_key_own_ * p) <= rise_;
  }

 private:
  /// Of a beam from the farthest place of a way that goes straight on.
  [[nodiscard]] static float rise_of(const Eigen::Vector3f& p_key) {
    return p_key.z() / std::hypot(std::abs(p_key.x()) + half_way_m, p_key.y());
  }

  Eigen::Isometry3f T_key_own_;
  float rise_ = std::numeric_limits<float>::lowest();
};

/// The place of these that is nearest to the point from above. There is one at least.
const Eigen::Vector3d& nearest_of(std::span<const Eigen::Vector3d> way,
                                  const Eigen::Vector3d& point) {
  return *std::ranges::min_element(way, {}, [&](const Eigen::Vector3d& place) {
    return (place - point).head<2>().squaredNorm();
  });
}

/// How far the farthest of them is from the point, from above [m].
double farthest_m(std::span<const Eigen::Vector3d> way, const Eigen::Vector3d& point) {
  double farthest = 0.0;
  for (const Eigen::Vector3d& place : way)
    farthest = std::max(farthest, (place - point).head<2>().norm());
  return farthest;
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
  const std::vector<Seen> seen = seen_of(roofed, own);
  const UpwardView view(own, T);
  std::size_t grounds = 0, roofs = 0, lacking = 0;
  std::vector<float> heights_m;
  for (const Eigen::Vector3f& ground : roofed.image.lowest_points()) {
    const std::size_t i = index_of(roofed.image, ground);
    if (columns[i].is_blocked || !seen[i].ground) continue;
    ++grounds;
    if (!columns[i].has_ceiling()) continue;
    ++roofs;
    const float above_m = columns[i].lowest_above_m;
    if (!view.reaches(ground + Eigen::Vector3f(0.0F, 0.0F, above_m + margin_m))) continue;
    heights_m.push_back(above_m);
    if (!seen[i].above) ++lacking;
  }
  const auto judged = static_cast<double>(heights_m.size());
  return static_cast<double>(roofs) >= min_roofed_share * static_cast<double>(grounds) &&
         one_height_m(std::move(heights_m)) &&
         static_cast<double>(lacking) >= min_lacking_share * judged;
}

bool is_open_above(const Submap& submap, std::span<const Eigen::Vector3d> own_way,
                   std::span<const Eigen::Vector3d> other_way, double height_m) {
  // A deck of 4.5 m over the street is 3 m over a lidar on a car: at 20 m, 8 degrees up.
  const double min_rise = std::max(0.14, (height_m - 2.5) / 20.0);
  const double highest_over_m = std::max(8.0, height_m + 3.0);
  constexpr std::size_t min_points_up = 50;
  constexpr double lowest_over_m = 0.7;
  constexpr double way_width_m = 1.5;
  // Farther from its own way it may not have seen what is there.
  constexpr double max_aside_m = 15.0;
  constexpr std::size_t min_places = 10;
  // Of places: on a whole submap a lamp hangs over one.
  constexpr std::size_t one_covered_of = 20;
  std::vector<Eigen::Vector3d> seen;
  for (const Eigen::Vector3d& place : other_way)
    if ((nearest_of(own_way, place) - place).head<2>().norm() < max_aside_m) seen.push_back(place);
  if (seen.size() < min_places) return false;
  std::vector<bool> is_covered(seen.size());
  std::size_t points_up = 0;
  for (const Eigen::Vector3f& point : submap.points_submap) {
    const Eigen::Vector3d p = point.cast<double>();
    // From wherever on the way it was hit, the beam rose by this.
    const double rise_m = p.z() - nearest_of(own_way, p).z();
    if (rise_m > min_rise * farthest_m(own_way, p)) ++points_up;
    const Eigen::Vector3d& below = nearest_of(seen, p);
    const Eigen::Vector3d over = p - below;
    if (over.z() > lowest_over_m && over.z() < highest_over_m &&
        over.head<2>().norm() < way_width_m)
      is_covered[static_cast<std::size_t>(&below - seen.data())] = true;
  }
  const auto covered = static_cast<std::size_t>(std::ranges::count(is_covered, true));
  return points_up >= min_points_up && covered * one_covered_of <= seen.size();
}

}  // namespace stillmap
