#include "core/segmentation/surface_slope.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

namespace stillmap {
namespace {

/// Lidars of uneven beams (HDL-64E) leave up to two empty rows between seen ones.
constexpr int reach_rows = 3;
constexpr float empty_m = -1.0F;

/// Profile of the scene in each column, an entry a pixel: horizontal distance, or `empty_m`, and
/// height of its point [m].
struct Profile {
  std::vector<float> distance_m;
  std::vector<float> height_m;
};

Profile profile_of(const RangeImage& image, std::span<const Eigen::Vector3f> points_lidar) {
  Profile profile{std::vector(image.pixel_count(), empty_m),
                  std::vector(image.pixel_count(), 0.0F)};
  for (std::size_t pixel = 0; pixel < image.pixel_count(); ++pixel) {
    const std::int32_t nearest = image.nearest()[pixel];
    if (nearest == RangeImage::none) continue;
    const Eigen::Vector3f& point = points_lidar[static_cast<std::size_t>(nearest)];
    profile.distance_m[pixel] = std::sqrt(point.x() * point.x() + point.y() * point.y());
    profile.height_m[pixel] = point.z();
  }
  return profile;
}

/// atan2, to 3e-4 rad: what a range image tells is less exact, and the library's takes most of the
/// time of the slope. 0 for (0, 0).
float angle_rad(float y, float x) {
  const float high = std::max(std::abs(x), std::abs(y)), low = std::min(std::abs(x), std::abs(y));
  const float a = high > 0.0F ? low / high : 0.0F;
  const float s = a * a;
  float angle = ((-0.0464964749F * s + 0.15931422F) * s - 0.327622764F) * s * a + a;
  angle = std::abs(y) > std::abs(x) ? std::numbers::pi_v<float> / 2 - angle : angle;
  angle = x < 0.0F ? std::numbers::pi_v<float> - angle : angle;
  return y < 0.0F ? -angle : angle;
}

/// Goes along some columns, row by row, and keeps what was last seen in each.
class ColumnSweep {
 public:
  ColumnSweep(const Profile& profile, std::size_t columns)
      : profile_(profile),
        distance_m_(columns),
        height_m_(columns),
        rows_ago_(columns, reach_rows + 1) {}

  /// Calls `use(pixel, distance_m, height_m)` for each pixel of a row, from `first` on, with
  /// the last seen pixel of its column within reach, or itself, and then looks at the row.
  template <class Use>
  void pass(std::size_t first, const Use& use) {
    for (std::size_t c = 0; c < rows_ago_.size(); ++c) {
      const float here_m = profile_.distance_m[first + c];
      const float height_m = profile_.height_m[first + c];
      const bool is_near = rows_ago_[c] <= reach_rows;
      use(first + c, is_near ? distance_m_[c] : here_m, is_near ? height_m_[c] : height_m);
      const bool is_seen = here_m >= 0.0F;
      distance_m_[c] = is_seen ? here_m : distance_m_[c];
      height_m_[c] = is_seen ? height_m : height_m_[c];
      rows_ago_[c] = is_seen ? 1 : rows_ago_[c] + 1;
    }
  }

 private:
  const Profile& profile_;
  std::vector<float> distance_m_;
  std::vector<float> height_m_;
  std::vector<int> rows_ago_;
};

}  // namespace

std::vector<float> surface_slope_rad(const RangeImage& image,
                                     std::span<const Eigen::Vector3f> points_lidar) {
  assert(image.point_count() == points_lidar.size());
  const Profile profile = profile_of(image, points_lidar);
  const auto rows = static_cast<std::size_t>(image.rows());
  const auto columns = static_cast<std::size_t>(image.columns());
  std::vector<float> away_m(image.pixel_count()), up_m(image.pixel_count());
  std::vector<float> slope_rad(image.pixel_count());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, columns, 256), [&](const auto& some) {
    ColumnSweep down(profile, some.size()), up(profile, some.size());
    for (std::size_t row = 0; row < rows; ++row) {
      down.pass(row * columns + some.begin(), [&](std::size_t pixel, float d, float z) {
        away_m[pixel] = d;
        up_m[pixel] = z;
      });
    }
    for (std::size_t row = rows; row-- > 0;) {
      up.pass(row * columns + some.begin(), [&](std::size_t pixel, float d, float z) {
        const float slope = angle_rad(up_m[pixel] - z, away_m[pixel] - d);
        slope_rad[pixel] = profile.distance_m[pixel] >= 0.0F ? slope : 0.0F;
      });
    }
  });
  return slope_rad;
}

}  // namespace stillmap
