#include "core/lidar/range_image.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace stillmap {
namespace {

constexpr auto pi = static_cast<float>(std::numbers::pi);

/// atan2 to 3e-7 radians without branches, so that the compiler makes vectors of it: reduced to
/// -tan(pi/8)..tan(pi/8), then Cephes' polynomial for single precision.
inline float fast_atan2(float y, float x) {
  const float abs_x = std::abs(x), abs_y = std::abs(y);
  const float larger = std::max(abs_x, abs_y), smaller = std::min(abs_x, abs_y);
  constexpr float tan_pi_8 = 0.41421356F;
  const bool upper = smaller > tan_pi_8 * larger;
  const float t = upper ? (smaller - larger) / (smaller + larger) : smaller / larger;
  const float z = t * t;
  const float polynomial =
      (((8.05374449538e-2F * z - 1.38776856032e-1F) * z + 1.99777106478e-1F) * z -
       3.33329491539e-1F) *
          z * t +
      t;
  float angle = polynomial + (upper ? pi / 4.0F : 0.0F);
  angle = abs_y > abs_x ? pi / 2.0F - angle : angle;
  angle = x < 0.0F ? pi - angle : angle;
  return std::copysign(angle, y);
}

/// Equation 1 with its constants worked out once.
class Projection {
 public:
  explicit Projection(const ProjectionModel& model)
      : rows_(model.rows),
        columns_(model.columns),
        fov_down_(static_cast<float>(model.fov_down)),
        columns_per_radian_(static_cast<float>(model.columns / (2.0 * std::numbers::pi))),
        rows_per_radian_(static_cast<float>(model.rows / (model.fov_up - model.fov_down))) {}

  /// Pixel of a point, whatever its values; meant for points that are finite and not the origin.
  [[nodiscard]] std::int32_t pixel(float x, float y, float z) const {
    const float yaw = fast_atan2(y, x);
    // asin(z/range), but as precise straight up as elsewhere.
    const float pitch = fast_atan2(z, std::sqrt(x * x + y * y));
    const float u = 0.5F * static_cast<float>(columns_) - yaw * columns_per_radian_;
    const float v = static_cast<float>(rows_) - (pitch - fov_down_) * rows_per_radian_;
    return inside(v, rows_) * columns_ + inside(u, columns_);
  }

 private:
  /// Rounded down and clamped; NaN becomes 0.
  static std::int32_t inside(float coordinate, std::int32_t size) {
    return static_cast<std::int32_t>(
        std::min(std::max(0.0F, coordinate), static_cast<float>(size - 1)));
  }

  std::int32_t rows_, columns_;
  float fov_down_;
  float columns_per_radian_, rows_per_radian_;
};

}  // namespace

ProjectionModel projection_model(const SensorModel& sensor) {
  return {.rows = sensor.rings,
          .columns = sensor.columns,
          .fov_up = sensor.fov_up,
          .fov_down = sensor.fov_down};
}

RangeImage::RangeImage(std::span<const Eigen::Vector3f> points_lidar, const ProjectionModel& model)
    : rows_(model.rows),
      columns_(model.columns),
      pixel_of_point_(points_lidar.size()),
      range_of_point_m_(points_lidar.size()),
      nearest_(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_), none),
      range_m_(nearest_.size(), -1.0F) {
  assert(model.rows > 0 && model.columns > 0 && model.fov_down < model.fov_up);
  project(points_lidar, model);
  find_nearest();
}

void RangeImage::project(std::span<const Eigen::Vector3f> points_lidar,
                         const ProjectionModel& model) {
  const Projection projection(model);
  const tbb::blocked_range<std::size_t> all(0, points_lidar.size(), 4096);
  tbb::parallel_for(all, [&](const auto& some) {
    for (std::size_t i = some.begin(); i < some.end(); ++i) {
      const float x = points_lidar[i].x(), y = points_lidar[i].y(), z = points_lidar[i].z();
      const float range = std::sqrt(x * x + y * y + z * z);
      const std::int32_t pixel = projection.pixel(x, y, z);
      const bool projectable = range > 0.0F && range <= std::numeric_limits<float>::max();
      range_of_point_m_[i] = range;
      pixel_of_point_[i] = projectable ? pixel : none;
    }
  });
}

void RangeImage::find_nearest() {
  for (std::size_t i = 0; i < pixel_of_point_.size(); ++i) {
    if (pixel_of_point_[i] == none) continue;
    const auto pixel = static_cast<std::size_t>(pixel_of_point_[i]);
    if (nearest_[pixel] != none && range_m_[pixel] <= range_of_point_m_[i]) continue;
    nearest_[pixel] = static_cast<std::int32_t>(i);
    range_m_[pixel] = range_of_point_m_[i];
  }
}

template <class Use>
void RangeImage::for_each_gap(int max_gap, const Use& use) const {
  for (int row = 0; row < rows_; ++row) {
    int last = -1;
    // Once round, and on to the end of a gap that lies across the border.
    for (int c = 0; c < columns_ + std::min(max_gap + 1, columns_); ++c) {
      if (nearest_[pixel(row, c < columns_ ? c : c - columns_)] == none) continue;
      if (last >= 0 && last < columns_ && c - last - 1 <= max_gap) use(row, last, c - last - 1);
      last = c;
    }
  }
}

double RangeImage::share_in_gaps(int max_gap) const {
  std::size_t seen = 0, in_gaps = 0;
  for_each_gap(max_gap, [&](int, int, int empty) {
    ++seen;
    in_gaps += static_cast<std::size_t>(empty);
  });
  return seen == 0 ? 0.0 : static_cast<double>(in_gaps) / static_cast<double>(seen + in_gaps);
}

RangeImage RangeImage::with_gaps_filled(int max_gap) const {
  RangeImage filled = *this;
  for_each_gap(max_gap, [&](int row, int column, int empty) {
    const std::size_t first = pixel(row, column);
    const std::size_t last = pixel(row, (column + empty + 1) % columns_);
    for (int k = 1; k <= empty; ++k) {
      const int from_last = empty + 1 - k;
      const bool takes_first = k != from_last ? k < from_last : range_m_[first] <= range_m_[last];
      const std::size_t source = takes_first ? first : last;
      const std::size_t into = pixel(row, (column + k) % columns_);
      filled.nearest_[into] = nearest_[source];
      filled.range_m_[into] = range_m_[source];
    }
  });
  return filled;
}

}  // namespace stillmap
