#include "core/picture/picture_frame.hpp"

#include <algorithm>
#include <opencv2/core.hpp>

namespace stillmap {

Eigen::AlignedBox2d xy_bounds(const MapSnapshot& view) {
  Eigen::AlignedBox2d box;
  for (const auto& tile : view.tiles) {
    box.extend(tile->info.bounds_map.min().head<2>().cast<double>());
    box.extend(tile->info.bounds_map.max().head<2>().cast<double>());
  }
  return box;
}

PictureFrame fit_frame(const Eigen::AlignedBox2d& box_map, int max_side_px) {
  constexpr double margin_m = 4.0;
  constexpr double max_px_per_m = 15.0;
  const Eigen::Vector2d size_m = box_map.sizes() + Eigen::Vector2d::Constant(2.0 * margin_m);
  PictureFrame frame;
  frame.px_per_m = std::min(max_px_per_m, max_side_px / size_m.maxCoeff());
  // The legend needs some width; a narrow map stands in its middle.
  const Eigen::Vector2d size_px = (size_m * frame.px_per_m).cwiseMax(Eigen::Vector2d(640.0, 200.0));
  frame.size = {cvCeil(size_px.x()), cvCeil(size_px.y())};
  frame.corner_map = box_map.center() - size_px / (2.0 * frame.px_per_m);
  return frame;
}

}  // namespace stillmap
