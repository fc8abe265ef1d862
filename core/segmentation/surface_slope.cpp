#include "core/segmentation/surface_slope.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cassert>
#include <cmath>

namespace stillmap {
namespace {

/// Lidars of uneven beams (HDL-64E) leave up to two empty rows between seen ones.
constexpr int reach_rows = 3;

/// Profile of the scene in each column: horizontal distance and height of each pixel's point [m].
struct Profile {
  float distance_m = 0.0F;
  float height_m = 0.0F;
};

std::vector<Profile> profile_of(const RangeImage& image,
                                std::span<const Eigen::Vector3f> points_lidar) {
  std::vector<Profile> profile(image.pixel_count());
  for (std::size_t pixel = 0; pixel < profile.size(); ++pixel) {
    const std::int32_t nearest = image.nearest()[pixel];
    if (nearest == RangeImage::none) continue;
    const Eigen::Vector3f& point = points_lidar[static_cast<std::size_t>(nearest)];
    profile[pixel] = {std::sqrt(point.x() * point.x() + point.y() * point.y()), point.z()};
  }
  return profile;
}

/// The next seen pixel of the column, `step` = -1 upwards or 1 downwards; the pixel itself where
/// none is within reach.
std::size_t next_seen(const RangeImage& image, int row, int column, int step) {
  for (int distance = 1; distance <= reach_rows; ++distance) {
    const int there = row + step * distance;
    if (there < 0 || there >= image.rows()) break;
    const std::size_t pixel = image.pixel(there, column);
    if (image.nearest()[pixel] != RangeImage::none) return pixel;
  }
  return image.pixel(row, column);
}

}  // namespace

std::vector<float> surface_slope_rad(const RangeImage& image,
                                     std::span<const Eigen::Vector3f> points_lidar) {
  assert(image.point_count() == points_lidar.size());
  const std::vector<Profile> profile = profile_of(image, points_lidar);
  std::vector<float> slope_rad(image.pixel_count(), 0.0F);
  const tbb::blocked_range<int> rows(0, image.rows());
  tbb::parallel_for(rows, [&](const auto& some) {
    for (int row = some.begin(); row < some.end(); ++row) {
      for (int column = 0; column < image.columns(); ++column) {
        const std::size_t pixel = image.pixel(row, column);
        if (image.nearest()[pixel] == RangeImage::none) continue;
        const Profile above = profile[next_seen(image, row, column, -1)];
        const Profile below = profile[next_seen(image, row, column, 1)];
        slope_rad[pixel] =
            std::atan2(above.height_m - below.height_m, above.distance_m - below.distance_m);
      }
    }
  });
  return slope_rad;
}

}  // namespace stillmap
