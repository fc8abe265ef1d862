#include "core/lidar/range_image_view.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <numbers>
#include <numeric>

namespace stillmap {
namespace {

/// Finer columns would leave pixels empty between the shots of a turning lidar.
constexpr int max_columns = 1024;

/// So many points are projected at once, in vector registers.
constexpr std::size_t batch_size = 256;

constexpr float pi = std::numbers::pi_v<float>;

/// Arc tangent of `t`, |t| <= 1, to 1e-5 rad: a five hundredth of a pixel.
inline float small_arc_tangent(float t) {
  const float s = t * t;
  return t * (0.99997726F +
              s * (-0.33262347F +
                   s * (0.19354346F + s * (-0.11643287F + s * (0.05265332F + s * -0.01172120F)))));
}

/// Without branches: the octant of the next point is anybody's guess, and of many points the
/// compiler makes vectors.
inline float fast_atan2(float y, float x) {
  const float width = std::abs(x);
  const float height = std::abs(y);
  const float larger = std::max(width, height);
  // Right above or below the lidar both are 0.
  const float within_octant = small_arc_tangent(
      std::min(width, height) / std::max(larger, std::numeric_limits<float>::min()));
  const float within_quadrant = height > width ? 0.5F * pi - within_octant : within_octant;
  return std::copysign(x < 0.0F ? pi - within_quadrant : within_quadrant, y);
}

/// From 0 to `last`; 0 where NaN, which no whole number is.
inline int whole(float share, float last) {
  const float at_least_0 = share > 0.0F ? share : 0.0F;
  return static_cast<int>(at_least_0 < last ? at_least_0 : last);
}

/// Between sparse beams as much is not seen to the sides as above and below.
int columns_for_half_a_row(float rows_per_rad, int columns) {
  const float columns_per_row = static_cast<float>(columns) / (2.0F * pi * rows_per_rad);
  return std::clamp(static_cast<int>(std::lround(0.5F * columns_per_row)), 1,
                    std::max(1, columns / 2));
}

/// What is thin lies so far in front of what the beams above and below it hit [m].
constexpr float min_gap_m = 0.5F;
/// Points of a pixel that are farther than its nearest one by more are of something else [m].
constexpr float max_depth_m = 0.3F;
/// Vehicles have as much space below them, or less: a beam that comes down by no more, behind a
/// vehicle far away that one beam alone hit, passed below it [m].
constexpr float min_drop_m = 0.2F;

/// Gaps of more columns between two returns of a row are no steps from shot to shot, and of fewer
/// gaps nothing is told.
constexpr int max_gap_columns = 16;
constexpr int min_gaps = 500;
/// With more columns than this from one shot to the next the image has fewer, ...
constexpr float max_columns_a_shot = 1.1F;
/// ... so that each has a shot, though these do not keep step with columns exactly.
constexpr float shots_a_column = 1.1F;
constexpr int min_columns = 32;

/// A surface goes on while its range changes by no more than this times the way across the ray
/// between two beams: 76 degrees from facing the lidar.
constexpr float max_slope = 4.0F;

/// A whole number that sorts as the float does, and the float of one.
inline std::int32_t ordered(float value) {
  const auto bits = std::bit_cast<std::int32_t>(value);
  return bits ^ ((bits >> 31) & std::numeric_limits<std::int32_t>::max());
}
inline float from_ordered(std::int32_t word) {
  return std::bit_cast<float>(word ^ ((word >> 31) & std::numeric_limits<std::int32_t>::max()));
}

}  // namespace

RangeImageView::RangeImageView(const Scan& scan, std::span<const SemanticClass> labels,
                               const SensorModel& sensor, const Eigen::Isometry3d& T_map_lidar,
                               std::vector<std::uint8_t>* is_thin)
    : rows_(sensor.rings),
      columns_(std::min(sensor.columns, max_columns)),
      fov_up_(static_cast<float>(sensor.fov_up)),
      rows_per_rad_(static_cast<float>(sensor.rings / (sensor.fov_up - sensor.fov_down))),
      columns_beside_(columns_for_half_a_row(rows_per_rad_, columns_)),
      pixels_(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_), 0.0F),
      below_row_top_(pixels_.size()),
      in_column_(pixels_.size()) {
  move_to(T_map_lidar);
  Returns returns(scan.size());
  measure(scan, labels, returns);
  // A lidar that fires less often than it has columns leaves pixels empty between its shots.
  if (const float between = columns_a_shot(); between > max_columns_a_shot) {
    const int full_columns = columns_;
    columns_ = std::max(
        min_columns, static_cast<int>(static_cast<float>(columns_) / (between * shots_a_column)));
    // A shot may be anywhere in its column: one more is asked to either side.
    columns_beside_ = columns_for_half_a_row(rows_per_rad_, columns_) + 1;
    const std::size_t count = static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_);
    pixels_.resize(count);
    below_row_top_.resize(count);
    in_column_.resize(count);
    full_column_ = std::min(256, 256 * columns_ / full_columns);
    measure(scan, labels, returns);
  }
  if (is_thin != nullptr) *is_thin = thin_ones(returns);
}

void RangeImageView::measure(const Scan& scan, std::span<const SemanticClass> labels,
                             Returns& returns) {
  const auto wider = [](const RowRange& a, const RowRange& b) {
    return RowRange{std::min(a.first, b.first), std::max(a.last, b.last)};
  };
  seen_rows_ = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, scan.size(), 4096), RowRange{},
      [&](const auto& block, const RowRange& rows) {
        RowRange all = rows;
        for (std::size_t i = block.begin(); i < block.end(); i += batch_size) {
          const std::size_t count = std::min(batch_size, block.end() - i);
          all = wider(all, project(std::span(scan.points_lidar).subspan(i, count), i, returns));
        }
        return all;
      },
      wider);
  // The points themselves, there and back through the map frame, are within.
  constexpr float rounding_rows = 1e-3F;
  seen_rows_.first -= rounding_rows;
  seen_rows_.last += rounding_rows;
  fill(returns, labels);
}

float RangeImageView::columns_a_shot() const {
  // So many rows tell.
  constexpr int enough_rows = 16;
  std::array<int, max_gap_columns + 1> gaps{};
  for (int row = 0; row < rows_; row += std::max(1, rows_ / enough_rows)) {
    int last = -1;
    for (int column = 0; column < columns_; ++column) {
      if (pixels_[index(row, column)] == 0.0F) continue;
      if (last >= 0 && column - last <= max_gap_columns)
        ++gaps[static_cast<std::size_t>(column - last)];
      last = column;
    }
  }
  const int all = std::accumulate(gaps.begin(), gaps.end(), 0);
  int median = 1;
  for (int seen = gaps[1]; 2 * seen < all; seen += gaps[static_cast<std::size_t>(median)]) ++median;
  int count = 0;
  int sum = 0;
  for (int gap = 1; gap <= std::min(2 * median, max_gap_columns); ++gap) {
    count += gaps[static_cast<std::size_t>(gap)];
    sum += gap * gaps[static_cast<std::size_t>(gap)];
  }
  return count < min_gaps ? 1.0F : static_cast<float>(sum) / static_cast<float>(count);
}

void RangeImageView::fill(const Returns& returns, std::span<const SemanticClass> labels) {
  // Range, whether it may move, and where in the pixel in one word each: one of two returns is
  // chosen without branches, since which comes first is anybody's guess.
  constexpr std::uint64_t empty = ~std::uint64_t{0};
  constexpr std::uint64_t may_move = 1U << 16U;
  // And one for returns that are in no pixel.
  std::vector<std::uint64_t> words(pixels_.size() + 1, empty);
  const std::size_t count = returns.pixels.size();
  for (std::size_t i = 0; i < count; ++i) {
    std::uint64_t& word = words[returns.pixels[i]];
    const bool is_movable_one = !labels.empty() && is_movable(labels[i]);
    const std::uint64_t found = std::uint64_t{std::bit_cast<std::uint32_t>(returns.ranges_m[i])}
                                    << 32U |
                                (is_movable_one ? may_move : 0U) | returns.places[i];
    const auto nearer = std::uint64_t{0} - static_cast<std::uint64_t>(found >> 32U < word >> 32U);
    word ^= (word ^ found) & nearer;
  }
  float* const pixels = pixels_.data();
  std::uint8_t* const below_row_top = below_row_top_.data();
  std::uint8_t* const in_column = in_column_.data();
  const std::uint64_t* const filled = words.data();
  const std::size_t pixel_count = pixels_.size();
  for (std::size_t k = 0; k < pixel_count; ++k) {
    const std::uint64_t word = filled[k];
    const bool is_empty = word == empty;
    const auto range_m = std::bit_cast<float>(static_cast<std::uint32_t>(word >> 32U));
    const float signed_range_m = (word & may_move) != 0 ? range_m : -range_m;
    pixels[k] = is_empty ? 0.0F : signed_range_m;
    below_row_top[k] = is_empty ? 0 : static_cast<std::uint8_t>(word >> 8U);
    in_column[k] = is_empty ? 0 : static_cast<std::uint8_t>(word);
  }
}

std::vector<std::uint8_t> RangeImageView::thin_ones(const Returns& returns) const {
  std::vector<std::uint8_t> is_thin_at(pixels_.size());
  std::vector<std::uint8_t> may_be_thin(static_cast<std::size_t>(columns_));
  // Of the outermost beams nothing is known above or below.
  for (int row = 1; row + 1 < rows_; ++row) {
    mark_alone_in_column(row, may_be_thin);
    for (int column = 0; column < columns_; ++column)
      if (may_be_thin[static_cast<std::size_t>(column)] != 0)
        is_thin_at[index(row, column)] = is_thin(row, column) ? 1 : 0;
  }
  const std::size_t count = returns.pixels.size();
  const std::size_t no_pixel = pixels_.size();
  std::vector<std::uint8_t> thin(count);
  std::uint8_t* const marks = thin.data();
  const std::uint8_t* const is_marked = is_thin_at.data();
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t pixel = returns.pixels[i];
    if (pixel == no_pixel || is_marked[pixel] == 0) continue;
    marks[i] = returns.ranges_m[i] <= std::abs(pixels_[pixel]) + max_depth_m ? 1 : 0;
  }
  return thin;
}

void RangeImageView::mark_alone_in_column(int row, std::span<std::uint8_t> alone) const {
  const float* const above = &pixels_[index(row - 1, 0)];
  const float* const own = &pixels_[index(row, 0)];
  const float* const below = &pixels_[index(row + 1, 0)];
  for (std::size_t column = 0; column < alone.size(); ++column) {
    const float range_m = std::abs(own[column]);
    const float above_m = std::abs(above[column]);
    const float below_m = std::abs(below[column]);
    const float behind_m = range_m + min_gap_m;
    // Beams that are not evenly spaced leave a row empty here and there: is_thin() looks on.
    const bool goes_on_above = (above_m > 0.0F) & (above_m <= behind_m);
    const bool goes_on_below = (below_m > 0.0F) & (below_m <= behind_m);
    alone[column] = ((range_m > 0.0F) & !goes_on_above & !goes_on_below) ? 1 : 0;
  }
}

void RangeImageView::move_to(const Eigen::Isometry3d& T_map_lidar) {
  T_lidar_map_ = T_map_lidar.inverse().cast<float>();
  origin_map_ = T_map_lidar.translation().cast<float>();
}

/// Where points are in an image, in fractions of rows and columns; whatever their coordinates are.
class RangeImageView::Places {
 public:
  explicit Places(const RangeImageView& view)
      : rows_per_rad_(view.rows_per_rad_),
        fov_up_(view.fov_up_),
        half_columns_(0.5F * static_cast<float>(view.columns_)),
        last_row_(static_cast<float>(view.rows_ - 1)),
        last_column_(static_cast<float>(view.columns_ - 1)),
        columns_(view.columns_),
        T_lidar_map_(view.T_lidar_map_.affine()) {}

  struct Place {
    float range_m, row, column;
    int whole_row, whole_column;
    /// In 256ths of the row and the column. The outermost beams may lie beyond.
    int below_row_top, in_column;
  };
  [[nodiscard]] Place of(float x, float y, float z) const {
    const float squared_across = x * x + y * y;
    const float across = std::sqrt(squared_across);
    Place place{};
    place.range_m = std::sqrt(squared_across + z * z);
    place.row = (fov_up_ - fast_atan2(z, across)) * rows_per_rad_;
    place.column = (1.0F - fast_atan2(y, x) / pi) * half_columns_;
    place.whole_row = whole(place.row, last_row_);
    place.whole_column = whole(place.column, last_column_);
    place.below_row_top = whole(256.0F * (place.row - static_cast<float>(place.whole_row)), 255.0F);
    place.in_column =
        whole(256.0F * (place.column - static_cast<float>(place.whole_column)), 255.0F);
    return place;
  }
  [[nodiscard]] Place of_map(const Eigen::Vector3f& p_map) const {
    const auto along = [&](Eigen::Index axis) {
      return T_lidar_map_(axis, 0) * p_map.x() + T_lidar_map_(axis, 1) * p_map.y() +
             T_lidar_map_(axis, 2) * p_map.z() + T_lidar_map_(axis, 3);
    };
    return of(along(0), along(1), along(2));
  }
  [[nodiscard]] std::uint32_t pixel(const Place& place) const {
    return static_cast<std::uint32_t>(place.whole_row * columns_ + place.whole_column);
  }

 private:
  float rows_per_rad_, fov_up_, half_columns_, last_row_, last_column_;
  int columns_;
  Eigen::Matrix<float, 3, 4> T_lidar_map_;
};

RangeImageView::RowRange RangeImageView::project(std::span<const Eigen::Vector3f> points_lidar,
                                                 std::size_t first_point, Returns& returns) const {
  const Places places(*this);
  const auto no_pixel = static_cast<std::uint32_t>(pixels_.size());
  // Half a row of slack: the outermost beams look along the edge of the field of view.
  const float last_row = static_cast<float>(rows_) + 0.5F;
  std::uint32_t* const pixels = &returns.pixels[first_point];
  float* const ranges_m = &returns.ranges_m[first_point];
  std::uint16_t* const in_pixels = &returns.places[first_point];
  // Of floats the compiler does not find the least of many at once.
  std::array<std::int32_t, batch_size> rows_low, rows_high;
  const std::int32_t no_low = ordered(RowRange{}.first), no_high = ordered(RowRange{}.last);
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    const auto place = places.of(points_lidar[i].x(), points_lidar[i].y(), points_lidar[i].z());
    const bool is_seen = (place.range_m > 0.0F) & (place.row >= -0.5F) & (place.row < last_row);
    pixels[i] = is_seen ? places.pixel(place) : no_pixel;
    ranges_m[i] = place.range_m;
    in_pixels[i] = static_cast<std::uint16_t>(place.below_row_top << 8 | place.in_column);
    rows_low[i] = is_seen ? ordered(place.row) : no_low;
    rows_high[i] = is_seen ? ordered(place.row) : no_high;
  }
  std::int32_t low = no_low, high = no_high;
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    low = std::min(low, rows_low[i]);
    high = std::max(high, rows_high[i]);
  }
  return {from_ordered(low), from_ordered(high)};
}

float RangeImageView::next_range_m(int row, int column, int step) const {
  // Beams that are not evenly spaced leave a row empty here and there.
  for (const int r : {row + step, row + 2 * step}) {
    if (r < 0 || r >= rows_) break;
    const float range_m = std::abs(pixels_[index(r, column)]);
    if (range_m > 0.0F) return range_m;
  }
  return std::numeric_limits<float>::infinity();
}

RangeImageView::Beside RangeImageView::nearest_beside(int row, int column, int step) const {
  Beside nearest;
  for (int offset = -1; offset <= 1; ++offset) {
    const int c = (column + offset + columns_) % columns_;
    for (const int r : {row + step, row + 2 * step}) {
      if (r < 0 || r >= rows_) break;
      const float range_m = std::abs(pixels_[index(r, c)]);
      if (range_m > 0.0F && range_m < nearest.range_m) nearest = {range_m, index(r, c)};
      if (range_m > 0.0F) break;
    }
  }
  return nearest;
}

bool RangeImageView::is_thin(int row, int column) const {
  const float range_m = std::abs(pixels_[index(row, column)]);
  if (range_m == 0.0F) return false;
  const float behind_m = range_m + min_gap_m;
  // What ends most looks comes first: a surface goes on in the next rows.
  if (next_range_m(row, column, 1) <= behind_m || next_range_m(row, column, -1) <= behind_m)
    return false;
  const Beside below = nearest_beside(row, column, 1);
  if (below.range_m <= behind_m || nearest_beside(row, column, -1).range_m <= behind_m ||
      std::isinf(below.range_m))
    return false;
  const auto below_row = static_cast<float>(below.pixel / static_cast<std::size_t>(columns_)) +
                         static_cast<float>(below_row_top_[below.pixel]) / 256.0F;
  const float elevation = fov_up_ - below_row / rows_per_rad_;
  return elevation >= 0.0F || (below.range_m - range_m) * -std::sin(elevation) >= min_drop_m;
}

bool RangeImageView::column_sees_past(const Direction& at, int column, float range_m) const {
  const std::size_t pixel = index(at.row, column);
  const float beside_m = std::abs(pixels_[pixel]);
  const bool has_return = beside_m > 0.0F;
  if (has_return && beside_m <= range_m) return false;
  const bool is_above = at.below_row_top < below_row_top_[pixel];
  return ((has_return && !is_above) || next_range_m(at.row, column, -1) > range_m) &&
         ((has_return && is_above) || next_range_m(at.row, column, 1) > range_m);
}

bool RangeImageView::sees_past(const Observation& point, float range_m) const {
  const Direction& at = point.at;
  // What ends most looks comes first: the returns in the point's own column.
  if (!column_sees_past(at, at.column, range_m)) return false;
  for (int offset = 1; offset <= columns_beside_; ++offset) {
    // The image is closed at the rear.
    const int left = at.column - offset < 0 ? at.column - offset + columns_ : at.column - offset;
    const int right =
        at.column + offset < columns_ ? at.column + offset : at.column + offset - columns_;
    if (!column_sees_past(at, left, range_m) || !column_sees_past(at, right, range_m)) return false;
  }
  return true;
}

bool RangeImageView::lies_on_surface(const Observation& point, float tolerance_m) const {
  const auto lies_between = [&](float a_m, float b_m) {
    return point.point_range_m > std::min(a_m, b_m) - tolerance_m &&
           point.point_range_m < std::max(a_m, b_m) + tolerance_m;
  };
  if (lies_between(point.range_m, point.range_m)) return true;
  const auto goes_on = [&](int row, int column, float angle_rad) {
    const float pixel = pixels_[index(row, column)];
    const float range_m = std::abs(pixel);
    return pixel != 0.0F && (pixel > 0.0F) == point.movable &&
           std::abs(range_m - point.range_m) <= max_slope * angle_rad * point.range_m &&
           lies_between(point.range_m, range_m);
  };
  const Direction& at = point.at;
  const float column_rad = 2.0F * pi / static_cast<float>(columns_);
  const float row_rad = 1.0F / rows_per_rad_;
  return goes_on(at.row, (at.column + 1) % columns_, column_rad) ||
         goes_on(at.row, (at.column + columns_ - 1) % columns_, column_rad) ||
         (at.row > 0 && goes_on(at.row - 1, at.column, row_rad)) ||
         (at.row + 1 < rows_ && goes_on(at.row + 1, at.column, row_rad));
}

bool RangeImageView::has_beam_beside(const Observation& point) const {
  if (full_column_ == 256) return true;
  const Direction& at = point.at;
  return std::abs(in_column_[index(at.row, at.column)] - at.in_column) <= full_column_;
}

bool RangeImageView::has_beam_near(const Observation& point, float distance_m) const {
  const Direction& at = point.at;
  const auto parts_of_row = [](int row, std::uint8_t below_top) { return 256 * row + below_top; };
  const float parts_per_m = 256.0F * rows_per_rad_ / point.point_range_m;
  const float most = distance_m * parts_per_m;
  const int own = parts_of_row(at.row, at.below_row_top);
  for (int row = std::max(0, at.row - 1); row <= std::min(rows_ - 1, at.row + 1); ++row) {
    for (int offset = -1; offset <= 1; ++offset) {
      const std::size_t pixel = index(row, (at.column + offset + columns_) % columns_);
      const int away = std::abs(parts_of_row(row, below_row_top_[pixel]) - own);
      if (pixels_[pixel] != 0.0F && static_cast<float>(away) <= most) return true;
    }
  }
  return false;
}

std::optional<RangeImageView::Observation> RangeImageView::observe(
    const Eigen::Vector3f& point_map) const {
  const auto place = Places(*this).of_map(point_map);
  const bool is_seen =
      place.range_m > 0.0F && place.row >= seen_rows_.first && place.row <= seen_rows_.last;
  if (!is_seen) return std::nullopt;
  const float pixel = pixels_[index(place.whole_row, place.whole_column)];
  if (pixel == 0.0F) return std::nullopt;
  return Observation{.range_m = std::abs(pixel),
                     .movable = pixel > 0.0F,
                     .point_range_m = place.range_m,
                     .at = {.row = place.whole_row,
                            .column = place.whole_column,
                            .below_row_top = static_cast<std::uint8_t>(place.below_row_top),
                            .in_column = static_cast<std::uint8_t>(place.in_column)}};
}

void RangeImageView::mark_measured_behind(std::span<const Eigen::Vector3f> points_map,
                                          const Behind& behind,
                                          std::span<std::uint8_t> is_measured) const {
  const Places places(*this);
  const RowRange seen_rows = seen_rows_;
  // Ranges are rounded here and where sees_past() is asked.
  constexpr float room = 1.0F - 1e-5F;
  constexpr float never_m = std::numeric_limits<float>::infinity();
  std::array<std::uint32_t, batch_size> pixels;
  std::array<float, batch_size> beyond_m;
  for (std::size_t first = 0; first < points_map.size(); first += batch_size) {
    const auto batch = points_map.subspan(first, std::min(batch_size, points_map.size() - first));
    for (std::size_t k = 0; k < batch.size(); ++k) {
      const auto place = places.of_map(batch[k]);
      const bool is_seen = (place.range_m > 0.0F) & (room * place.range_m <= behind.max_range_m) &
                           (place.row >= seen_rows.first) & (place.row <= seen_rows.last);
      pixels[k] = places.pixel(place);
      const float range_m = place.range_m + behind.distance_m + behind.share * place.range_m;
      beyond_m[k] = is_seen ? room * range_m : never_m;
    }
    for (std::size_t k = 0; k < batch.size(); ++k)
      is_measured[first + k] = std::abs(pixels_[pixels[k]]) > beyond_m[k] ? 1 : 0;
  }
}

}  // namespace stillmap
