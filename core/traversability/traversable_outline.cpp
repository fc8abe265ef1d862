#include "core/traversability/traversable_outline.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace stillmap {
namespace {

cv::Mat1b free_cells(const OccupancyGrid& grid) {
  cv::Mat1b free(static_cast<int>(grid.height), static_cast<int>(grid.width));
  for (int y = 0; y < free.rows; ++y) {
    for (int x = 0; x < free.cols; ++x) {
      const std::int8_t value =
          grid.at(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
      free(y, x) = value >= 0 && value < occupancy_inscribed ? 255 : 0;
    }
  }
  return free;
}

/// Twice the area, positive when anticlockwise.
double signed_area_m2(const TraversableRing& ring) {
  double twice = 0.0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Eigen::Vector2d& a = ring[i];
    const Eigen::Vector2d& b = ring[(i + 1) % ring.size()];
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return 0.5 * twice;
}

TraversableRing ring_of(const std::vector<cv::Point>& contour, const OccupancyGrid& grid,
                        bool is_anticlockwise) {
  TraversableRing ring;
  for (const cv::Point& cell : contour) {
    ring.push_back(grid.origin_map +
                   grid.resolution_m * Eigen::Vector2d(cell.x + 0.5, cell.y + 0.5));
  }
  if ((signed_area_m2(ring) > 0.0) != is_anticlockwise) std::reverse(ring.begin(), ring.end());
  return ring;
}

}  // namespace

double area_m2(const TraversablePolygon& polygon) {
  double area = std::abs(signed_area_m2(polygon.outer));
  for (const TraversableRing& hole : polygon.holes) area -= std::abs(signed_area_m2(hole));
  return area;
}

std::vector<TraversablePolygon> free_outlines(const OccupancyGrid& grid, double min_area_m2) {
  if (grid.data.empty()) return {};
  std::vector<std::vector<cv::Point>> contours;
  // Of every contour: the next and the previous one of its level, its first child, its parent.
  std::vector<cv::Vec4i> family;
  cv::findContours(free_cells(grid), contours, family, cv::RETR_CCOMP, cv::CHAIN_APPROX_SIMPLE);
  std::vector<TraversablePolygon> polygons;
  for (std::size_t i = 0; i < contours.size(); ++i) {
    const bool is_hole = family[i][3] >= 0;
    if (is_hole) continue;
    TraversablePolygon polygon;
    polygon.outer = ring_of(contours[i], grid, true);
    for (int hole = family[i][2]; hole >= 0; hole = family[static_cast<std::size_t>(hole)][0]) {
      polygon.holes.push_back(ring_of(contours[static_cast<std::size_t>(hole)], grid, false));
    }
    if (area_m2(polygon) >= min_area_m2) polygons.push_back(std::move(polygon));
  }
  std::ranges::stable_sort(polygons, std::ranges::greater{}, area_m2);
  return polygons;
}

}  // namespace stillmap
