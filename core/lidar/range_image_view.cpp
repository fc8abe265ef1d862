#include "core/lidar/range_image_view.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <array>
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
constexpr Eigen::Index batch_size = 256;
using Batch = Eigen::Array<float, batch_size, 1>;
using WholeBatch = Eigen::Array<int, batch_size, 1>;

constexpr float pi = std::numbers::pi_v<float>;

/// Arc tangent of `t`, |t| <= 1, to 1e-5 rad: a five hundredth of a pixel.
template <class T>
T small_arc_tangent(const T& t) {
  const T s = t * t;
  return t * (0.99997726F +
              s * (-0.33262347F +
                   s * (0.19354346F + s * (-0.11643287F + s * (0.05265332F + s * -0.01172120F)))));
}

float fast_atan2(float y, float x) {
  // Without branches: the octant of the next point is anybody's guess.
  const float width = std::abs(x);
  const float height = std::abs(y);
  const float larger = std::max(width, height);
  const float within_octant =
      small_arc_tangent(std::min(width, height) / (larger > 0.0F ? larger : 1.0F));
  const float within_quadrant = height > width ? 0.5F * pi - within_octant : within_octant;
  return std::copysign(x < 0.0F ? pi - within_quadrant : within_quadrant, y);
}

/// The same for many.
Batch fast_atan2(const Batch& y, const Batch& x) {
  // Right above or below the lidar both are 0.
  const Batch larger = x.abs().max(y.abs()).max(std::numeric_limits<float>::min());
  const Batch smaller = x.abs().min(y.abs());
  Batch angle = small_arc_tangent<Batch>(smaller / larger);
  angle = (y.abs() > x.abs()).select(0.5F * pi - angle, angle);
  angle = (x < 0.0F).select(pi - angle, angle);
  return (y < 0.0F).select(-angle, angle);
}

/// From 0 to `last`; 0 where NaN, which no whole number is.
WholeBatch whole(const Batch& share, float last) {
  WholeBatch result;
  for (Eigen::Index k = 0; k < batch_size; ++k) {
    const float at_least_0 = share[k] > 0.0F ? share[k] : 0.0F;
    result[k] = static_cast<int>(at_least_0 < last ? at_least_0 : last);
  }
  return result;
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

/// How far from the first edge of its row or column, in 256ths of it. The outermost beams may lie
/// beyond.
std::uint8_t share_of_pixel(float at, float edge) {
  return static_cast<std::uint8_t>(std::clamp(256.0F * (at - edge), 0.0F, 255.0F));
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
  std::vector<Return> returns(scan.size());
  measure(scan, labels, returns);
  // A lidar that fires less often than it has columns leaves pixels empty between its shots.
  if (const float between = columns_a_shot(); between > max_columns_a_shot) {
    const int full_columns = columns_;
    columns_ = std::max(
        min_columns, static_cast<int>(static_cast<float>(columns_) / (between * shots_a_column)));
    // A shot may be anywhere in its column: one more is asked to either side.
    columns_beside_ = columns_for_half_a_row(rows_per_rad_, columns_) + 1;
    pixels_.assign(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_), 0.0F);
    below_row_top_.assign(pixels_.size(), 0);
    in_column_.assign(pixels_.size(), 0);
    full_column_ = std::min(256, 256 * columns_ / full_columns);
    measure(scan, labels, returns);
  }
  if (is_thin != nullptr) *is_thin = thin_ones(returns);
}

void RangeImageView::measure(const Scan& scan, std::span<const SemanticClass> labels,
                             std::vector<Return>& returns) {
  const auto wider = [](const RowRange& a, const RowRange& b) {
    return RowRange{std::min(a.first, b.first), std::max(a.last, b.last)};
  };
  seen_rows_ = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, scan.size(), 4096), RowRange{},
      [&](const auto& block, RowRange rows) {
        constexpr auto step = static_cast<std::size_t>(batch_size);
        for (std::size_t i = block.begin(); i < block.end(); i += step) {
          const std::size_t count = std::min(step, block.end() - i);
          rows = wider(rows, project(std::span(scan.points_lidar).subspan(i, count),
                                     std::span(returns).subspan(i, count)));
        }
        return rows;
      },
      wider);
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

void RangeImageView::fill(std::span<const Return> returns, std::span<const SemanticClass> labels) {
  float* const pixels = pixels_.data();
  std::uint8_t* const below_row_top = below_row_top_.data();
  std::uint8_t* const in_column = in_column_.data();
  for (std::size_t i = 0; i < returns.size(); ++i) {
    const Return& found = returns[i];
    if (found.pixel == none) continue;
    // Without branches: which of two returns comes first is anybody's guess.
    const float old = pixels[found.pixel];
    const std::uint8_t old_below = below_row_top[found.pixel];
    const bool is_nearer = (old == 0.0F) | (found.range_m < std::abs(old));
    const bool may_move = !labels.empty() && is_movable(labels[i]);
    const float signed_range = may_move ? found.range_m : -found.range_m;
    pixels[found.pixel] = is_nearer ? signed_range : old;
    below_row_top[found.pixel] = is_nearer ? found.below_row_top : old_below;
    in_column[found.pixel] = is_nearer ? found.in_column : in_column[found.pixel];
  }
}

std::vector<std::uint8_t> RangeImageView::thin_ones(std::span<const Return> returns) const {
  std::vector<std::uint8_t> is_thin_at(pixels_.size());
  std::vector<std::uint8_t> may_be_thin(static_cast<std::size_t>(columns_));
  // Of the outermost beams nothing is known above or below.
  for (int row = 1; row + 1 < rows_; ++row) {
    mark_alone_in_column(row, may_be_thin);
    for (int column = 0; column < columns_; ++column)
      if (may_be_thin[static_cast<std::size_t>(column)] != 0)
        is_thin_at[index(row, column)] = is_thin(row, column) ? 1 : 0;
  }
  std::vector<std::uint8_t> thin(returns.size());
  std::ranges::transform(returns, thin.begin(), [&](const Return& point) -> std::uint8_t {
    if (point.pixel == none || is_thin_at[point.pixel] == 0) return 0;
    return point.range_m <= std::abs(pixels_[point.pixel]) + max_depth_m ? 1 : 0;
  });
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
    alone[column] = (range_m > 0.0F) & !goes_on_above & !goes_on_below ? 1 : 0;
  }
}

void RangeImageView::move_to(const Eigen::Isometry3d& T_map_lidar) {
  T_lidar_map_ = T_map_lidar.inverse().cast<float>();
  origin_map_ = T_map_lidar.translation().cast<float>();
}

RangeImageView::RowRange RangeImageView::project(std::span<const Eigen::Vector3f> points_lidar,
                                                 std::span<Return> returns) const {
  Batch x = Batch::Ones(), y = Batch::Ones(), z = Batch::Ones();
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    x[k] = points_lidar[i].x();
    y[k] = points_lidar[i].y();
    z[k] = points_lidar[i].z();
  }
  const Batch across = (x.square() + y.square()).sqrt();
  const Batch range_m = (across.square() + z.square()).sqrt();
  const Batch row = (fov_up_ - fast_atan2(z, across)) * rows_per_rad_;
  const Batch column = 0.5F * (1.0F - fast_atan2(y, x) / pi) * static_cast<float>(columns_);
  const WholeBatch r = whole(row, static_cast<float>(rows_ - 1));
  const WholeBatch c = whole(column, static_cast<float>(columns_ - 1));
  const WholeBatch pixel = r * columns_ + c;
  const WholeBatch in_column = whole(256.0F * (column - c.cast<float>()), 255.0F);
  const WholeBatch below_row_top = whole(256.0F * (row - r.cast<float>()), 255.0F);
  // Half a row of slack: the outermost beams look along the edge of the field of view.
  const float last_row = static_cast<float>(rows_) + 0.5F;
  RowRange rows;
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const bool is_seen = (range_m[k] > 0.0F) & (row[k] >= -0.5F) & (row[k] < last_row);
    returns[i] = {is_seen ? static_cast<std::uint32_t>(pixel[k]) : none, range_m[k],
                  static_cast<std::uint8_t>(below_row_top[k]),
                  static_cast<std::uint8_t>(in_column[k])};
    rows.first = is_seen ? std::min(rows.first, row[k]) : rows.first;
    rows.last = is_seen ? std::max(rows.last, row[k]) : rows.last;
  }
  return rows;
}

std::optional<RangeImageView::Direction> RangeImageView::direction_of(
    const Eigen::Vector3f& point_lidar, float range_m) const {
  const float elevation = fast_atan2(point_lidar.z(), point_lidar.head<2>().norm());
  const float turn = 0.5F * (1.0F - fast_atan2(point_lidar.y(), point_lidar.x()) / pi);
  const float row = (fov_up_ - elevation) * rows_per_rad_;
  const bool is_seen = range_m > 0.0F && row >= seen_rows_.first && row <= seen_rows_.last;
  if (!is_seen) return std::nullopt;
  const int r = std::clamp(static_cast<int>(row), 0, rows_ - 1);
  const float column = turn * static_cast<float>(columns_);
  const int c = std::clamp(static_cast<int>(column), 0, columns_ - 1);
  return Direction{.row = r,
                   .column = c,
                   .below_row_top = share_of_pixel(row, static_cast<float>(r)),
                   .in_column = share_of_pixel(column, static_cast<float>(c))};
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
  const Eigen::Vector3f point_lidar = T_lidar_map_ * point_map;
  Observation observation{};
  observation.point_range_m = point_lidar.norm();
  const std::optional<Direction> at = direction_of(point_lidar, observation.point_range_m);
  if (!at) return std::nullopt;
  const float pixel = pixels_[index(at->row, at->column)];
  if (pixel == 0.0F) return std::nullopt;
  observation.range_m = std::abs(pixel);
  observation.movable = pixel > 0.0F;
  observation.direction_map = (point_map - origin_map_) / observation.point_range_m;
  observation.at = *at;
  return observation;
}

}  // namespace stillmap
