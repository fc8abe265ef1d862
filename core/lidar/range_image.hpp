#pragma once

#include <Eigen/Core>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// Size and vertical field of view of a range image; it covers 360 degrees across. Angles in
/// radians, elevation positive upwards.
struct ProjectionModel {
  int rows = 64;
  int columns = 1024;
  double fov_up = 0.0;
  double fov_down = 0.0;
};

/// One row a ring over the sensor's field of view.
[[nodiscard]] ProjectionModel projection_model(const SensorModel& sensor);

/// Spherical projection of a scan by what the paper's equation 1 means (as RangeNet++ does it):
///   u = 1/2 (1 - atan2(y, x)/pi) columns,
///   v = (1 - (asin(z/range) - fov_down)/(fov_up - fov_down)) rows,
/// rounded down and clamped: points above or below the field of view fall into the first or last
/// row. Column columns/2 begins at +x, +y lies in the left half. The printed equation takes arcsin
/// of y/x and adds the fields of view with the wrong sign; the weights are trained with this one.
///
/// Points with range 0 or that are not finite have no pixel.
class RangeImage {
 public:
  /// Pixel of a point that has none, point of a pixel that has none.
  static constexpr std::int32_t none = -1;

  /// Requires rows, columns > 0 and fov_down < fov_up.
  RangeImage(std::span<const Eigen::Vector3f> points_lidar, const ProjectionModel& model);

  [[nodiscard]] int rows() const { return rows_; }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] std::size_t pixel_count() const { return nearest_.size(); }
  [[nodiscard]] std::size_t point_count() const { return pixel_of_point_.size(); }

  /// Pixels are numbered row by row: row * columns + column.
  [[nodiscard]] std::size_t pixel(int row, int column) const {
    assert(row >= 0 && row < rows_ && column >= 0 && column < columns_);
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  /// Index of the nearest point of each pixel, of equally near ones the first; or `none`.
  [[nodiscard]] std::span<const std::int32_t> nearest() const { return nearest_; }
  /// Range of the nearest point of each pixel [m], or -1.
  [[nodiscard]] std::span<const float> range_m() const { return range_m_; }
  /// Pixel of each point, or `none`.
  [[nodiscard]] std::span<const std::int32_t> pixel_of_point() const { return pixel_of_point_; }
  /// Range of each point [m]; not finite where the point is not.
  [[nodiscard]] std::span<const float> range_of_point_m() const { return range_of_point_m_; }

  /// Empty pixels between two that see something in one row, at most `max_gap` of them side by
  /// side, as a share of both: near 0 where a lidar fires once a column, 0.5 where it does every
  /// other one. Rows go round.
  [[nodiscard]] double share_in_gaps(int max_gap) const;
  /// The image in which these pixels see what the nearer end of their gap does; in the middle of it
  /// the end of less range. Points keep their pixels.
  [[nodiscard]] RangeImage with_gaps_filled(int max_gap) const;

 private:
  void project(std::span<const Eigen::Vector3f> points_lidar, const ProjectionModel& model);
  void find_nearest();
  /// Calls `use(row, column, empty)` for each pixel that sees something, where the next one that
  /// does follows in its row after at most `max_gap` empty ones.
  template <class Use>
  void for_each_gap(int max_gap, const Use& use) const;

  int rows_;
  int columns_;
  std::vector<std::int32_t> pixel_of_point_;
  std::vector<float> range_of_point_m_;
  std::vector<std::int32_t> nearest_;
  std::vector<float> range_m_;
};

/// Gives each point the value of its pixel, and `otherwise` to points without one. `values` has
/// one entry a pixel.
template <class T>
[[nodiscard]] std::vector<T> unproject(const RangeImage& image, std::span<const T> values,
                                       const T& otherwise) {
  assert(values.size() == image.pixel_count());
  std::vector<T> of_point;
  of_point.reserve(image.point_count());
  for (const std::int32_t pixel : image.pixel_of_point()) {
    of_point.push_back(pixel == RangeImage::none ? otherwise
                                                 : values[static_cast<std::size_t>(pixel)]);
  }
  return of_point;
}

}  // namespace stillmap
