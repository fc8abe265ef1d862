#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// A posed range image: the ranges of a scan over direction, and the pose it was taken from.
class RangeImageView {
 public:
  RangeImageView(const Scan& scan, std::span<const SemanticClass> labels, const SensorModel& sensor,
                 const Eigen::Isometry3d& T_map_lidar)
      : RangeImageView(scan, labels, sensor, T_map_lidar, nullptr) {}
  /// The same without labels. Tells of each point in `is_thin` (1 or 0) whether it is of something
  /// thin and level, a bar, a chain or a twig, that one beam alone hit: those above and below it go
  /// on behind it, and that below it comes down by more than there is below a vehicle.
  RangeImageView(const Scan& scan, const SensorModel& sensor, const Eigen::Isometry3d& T_map_lidar,
                 std::vector<std::uint8_t>& is_thin)
      : RangeImageView(scan, {}, sensor, T_map_lidar, &is_thin) {}

  /// Where a point is in the image.
  struct Direction {
    int row, column;
    std::uint8_t below_row_top;
    /// How far right of its left edge, in 256ths of the column.
    std::uint8_t in_column;
  };
  /// What was measured in the direction of a point.
  struct Observation {
    float range_m;
    bool movable;
    /// From this view's lidar to the point [m].
    float point_range_m;
    Direction at;
  };
  /// Empty where nothing was measured, and beyond the outermost beams: half a row below the lowest
  /// one the ground is already nearer than what that one hit.
  [[nodiscard]] std::optional<Observation> observe(const Eigen::Vector3f& point_map) const;

  /// How far behind a point returns must be for the rays to have passed it: so far and this share
  /// of the point's range, of points up to a range.
  struct Behind {
    float distance_m = 0.0F;
    float share = 0.0F;
    float max_range_m = std::numeric_limits<float>::infinity();
  };
  /// Of many points at once (map frame [m]): 0 where nothing was measured so far behind a point in
  /// its own direction, so that sees_past() would not hold either, else 1. Within rounding.
  void mark_measured_behind(std::span<const Eigen::Vector3f> points_map, const Behind& behind,
                            std::span<std::uint8_t> is_measured) const;

  /// Whether all returns around a point are farther than a range: those of the beams that pass
  /// above and below it, as far to the sides as rows are apart, one column at least.
  [[nodiscard]] bool sees_past(const Observation& point, float range_m) const;

  /// Whether a point lies, within a tolerance, on what was measured in its direction, or on the
  /// surface that goes on from there to the next row or column: along a wall that is seen at a
  /// grazing angle ranges change by more from one beam to the next. Both may move, or neither.
  [[nodiscard]] bool lies_on_surface(const Observation& point, float tolerance_m) const;

  /// Whether one of the beams that measured something round a point goes past it nearer than this
  /// [m], up or down, and not only on either side of it.
  [[nodiscard]] bool has_beam_near(const Observation& point, float distance_m) const;

  /// Whether the beam that measured something in the direction of a point passes it no farther to
  /// the side than columns of a full image are wide: between the shots of a lidar that fires seldom
  /// may be a pole. Always, where columns were not made wider.
  [[nodiscard]] bool has_beam_beside(const Observation& point) const;

  [[nodiscard]] const Eigen::Vector3f& origin_map() const { return origin_map_; }

  /// Replaces the pose.
  void move_to(const Eigen::Isometry3d& T_map_lidar);

 private:
  class Places;
  /// Where the points of a scan were measured.
  struct Returns {
    explicit Returns(std::size_t count) : pixels(count), ranges_m(count), places(count) {}

    /// The pixel, or the number of pixels outside the field of view or without a range.
    std::vector<std::uint32_t> pixels;
    std::vector<float> ranges_m;
    /// How far below the top of its row, and right of the left edge of its column, each in 256ths
    /// in 8 bits.
    std::vector<std::uint16_t> places;
  };
  /// The nearest return up or down from a pixel.
  struct Beside {
    float range_m = std::numeric_limits<float>::infinity();
    std::size_t pixel = 0;
  };
  struct RowRange {
    float first = std::numeric_limits<float>::max();
    float last = std::numeric_limits<float>::lowest();
  };
  RangeImageView(const Scan& scan, std::span<const SemanticClass> labels, const SensorModel& sensor,
                 const Eigen::Isometry3d& T_map_lidar, std::vector<std::uint8_t>* is_thin);
  /// Projects and fills as many columns as there are.
  void measure(const Scan& scan, std::span<const SemanticClass> labels, Returns& returns);
  /// From one column in which something was measured to the next one of its row, where the lidar
  /// fires once in so many columns, 1 or more: the mean without gaps where rays did not return.
  [[nodiscard]] float columns_a_shot() const;
  /// Of some of the points, from this one on. Returns the rows between which they lie.
  RowRange project(std::span<const Eigen::Vector3f> points_lidar, std::size_t first_point,
                   Returns& returns) const;
  /// Of each pixel the nearest return.
  void fill(const Returns& returns, std::span<const SemanticClass> labels);
  [[nodiscard]] std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row * columns_ + column);
  }
  /// Of the next row up (-1) or down (1) that measured something in a column, or the next but one;
  /// else infinite.
  [[nodiscard]] float next_range_m(int row, int column, int step) const;
  /// Up (-1) or down (1), in a column and those on either side of it.
  [[nodiscard]] Beside nearest_beside(int row, int column, int step) const;
  /// Which of the scan's points one beam alone hit (see the constructor).
  [[nodiscard]] std::vector<std::uint8_t> thin_ones(const Returns& returns) const;
  [[nodiscard]] bool is_thin(int row, int column) const;
  /// Of the pixels of a row between two others: 1 where is_thin() may hold, since no surface goes
  /// on in the rows right above and below, 0 where one does, or where nothing was measured.
  void mark_alone_in_column(int row, std::span<std::uint8_t> alone) const;
  /// Whether the beams above and below a point see past a range in a column.
  [[nodiscard]] bool column_sees_past(const Direction& at, int column, float range_m) const;

  int rows_;
  int columns_;
  float fov_up_;
  float rows_per_rad_;
  /// Of the outermost returns, as fractions of rows.
  RowRange seen_rows_;
  /// So many to each side are half a row wide.
  int columns_beside_;
  Eigen::Isometry3f T_lidar_map_;
  Eigen::Vector3f origin_map_;
  /// Range [m], negative for surfaces that are not movable; 0 where nothing was measured.
  std::vector<float> pixels_;
  /// Where in its row it was measured, in 256ths from the top: a row may have several beams.
  std::vector<std::uint8_t> below_row_top_;
  /// Where in its column, in 256ths from the left.
  std::vector<std::uint8_t> in_column_;
  /// Width of a column before it was fitted to the shots, in 256ths of a column now; 256: as now.
  int full_column_ = 256;
};

}  // namespace stillmap
