#include "core/picture/picture_raster.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

constexpr float roof_height_m = 8.0F;
constexpr float nothing = -1e9F;

/// Of every pixel, what is seen from above.
struct TopView {
  cv::Mat1f height_m;
  /// Height by which pixels compete: that of poles and signs is raised.
  cv::Mat1f rank_m;
  cv::Mat1b label;
};

bool is_thin(SemanticClass label) {
  return label == SemanticClass::pole || label == SemanticClass::traffic_sign;
}

cv::Rect pixels_of(const Eigen::Vector3d& corner_map, double voxel_size_m,
                   const PictureFrame& frame, int min_side_px) {
  const cv::Point2d low = frame.pixel(corner_map.head<2>());
  const cv::Point2d high =
      frame.pixel(corner_map.head<2>() + Eigen::Vector2d::Constant(voxel_size_m));
  const int x = static_cast<int>(std::lround(low.x));
  const int y = static_cast<int>(std::lround(high.y));
  const cv::Rect cell(x, y, std::max(static_cast<int>(std::lround(high.x)) - x, min_side_px),
                      std::max(static_cast<int>(std::lround(low.y)) - y, min_side_px));
  return cell & cv::Rect({0, 0}, frame.size);
}

TopView rasterize_top_view(const MapSnapshot& view, const PictureFrame& frame) {
  TopView top{cv::Mat1f(frame.size, nothing), cv::Mat1f(frame.size, nothing),
              cv::Mat1b(frame.size, 0)};
  const VoxelGrid grid(view.voxel_size_m, view.tile_size_m);
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      const SemanticClass label = voxel.evidence.winner();
      const float rank_m = voxel.mean_map.z() + (is_thin(label) ? 1000.0F : 0.0F);
      const cv::Rect cell = pixels_of(grid.corner_map(tile->info.id, voxel.index),
                                      view.voxel_size_m, frame, is_thin(label) ? 3 : 1);
      for (int y = cell.y; y < cell.y + cell.height; ++y) {
        for (int x = cell.x; x < cell.x + cell.width; ++x) {
          if (rank_m <= top.rank_m(y, x)) continue;
          top.rank_m(y, x) = rank_m;
          top.height_m(y, x) = voxel.mean_map.z();
          top.label(y, x) = static_cast<std::uint8_t>(label);
        }
      }
    }
  }
  return top;
}

/// Height of the ground under every pixel: the lowest voxel of each 6 m square, single squares that
/// are too low (reflections) overruled by their neighbours, smoothly joined.
cv::Mat1f ground_height(const MapSnapshot& view, const PictureFrame& frame) {
  constexpr double square_m = 6.0;
  const double scale = 1.0 / (square_m * frame.px_per_m);
  cv::Mat1f lowest(std::max(1, cvCeil(frame.size.height * scale)),
                   std::max(1, cvCeil(frame.size.width * scale)), -nothing);
  const cv::Rect inside({0, 0}, lowest.size());
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      const cv::Point2d p = frame.pixel(voxel.mean_map.head<2>().cast<double>()) * scale;
      const cv::Point square(cvFloor(p.x), cvFloor(p.y));
      if (!inside.contains(square)) continue;
      lowest(square) = std::min(lowest(square), voxel.mean_map.z());
    }
  }
  // Median first: an empty square counts as high, and gets its lowest neighbour in the end.
  cv::medianBlur(lowest, lowest, 3);
  cv::Mat1f filled = lowest.clone();
  for (int i = 0; i < 3; ++i) {
    cv::Mat1f spread;
    cv::erode(filled, spread, cv::Mat());
    spread.copyTo(filled, filled > -nothing / 2);
  }
  cv::blur(filled, filled, {3, 3});
  cv::Mat1f ground;
  cv::resize(filled, ground, frame.size, 0, 0, cv::INTER_LINEAR);
  return ground;
}

/// Height against the mean height of the surroundings [m]: kerbs and edges stand out.
cv::Mat1f relief(const cv::Mat1f& height_m, const cv::Mat1b& is_seen, double px_per_m) {
  const int reach_px = 2 * std::max(1, cvRound(1.5 * px_per_m)) + 1;
  cv::Mat1f seen;
  is_seen.convertTo(seen, CV_32F, 1.0 / 255.0);
  cv::Mat1f sum;
  cv::multiply(height_m, seen, sum);
  cv::Mat1f weight;
  cv::blur(sum, sum, {reach_px, reach_px});
  cv::blur(seen, weight, {reach_px, reach_px});
  cv::divide(sum, weight, sum);  // division by 0 gives 0
  cv::Mat1f above_mean;
  cv::subtract(height_m, sum, above_mean);
  return above_mean;
}

/// Colour and brightness of one pixel.
cv::Vec3b shade(SemanticClass label, float above_ground_m, float relief_m) {
  const float height = std::clamp(above_ground_m / roof_height_m, 0.0F, 1.0F);
  const cv::Vec3f colour =
      label == SemanticClass::unlabeled ? height_colour(height) : class_colour(label);
  const float edge = std::clamp(1.0F + (is_ground(label) ? 3.0F : 0.25F) * relief_m, 0.6F, 1.5F);
  const float lift = is_ground(label) || is_thin(label) ? 1.0F : 0.7F + 0.35F * height;
  const cv::Vec3f lit = colour * (edge * lift);
  return {cv::saturate_cast<std::uint8_t>(lit[0]), cv::saturate_cast<std::uint8_t>(lit[1]),
          cv::saturate_cast<std::uint8_t>(lit[2])};
}

}  // namespace

cv::Scalar background() { return {30, 24, 20}; }

cv::Vec3f class_colour(SemanticClass label) {
  const Rgb rgb = colour(label);
  const cv::Vec3f bgr(rgb.b, rgb.g, rgb.r);
  // Dimmed, but never down to the background: a sidewalk's own colour is nearly black.
  return is_ground(label) ? bgr * 0.5F + cv::Vec3f::all(38.0F) : bgr;
}

cv::Vec3f height_colour(float height) {
  // Slate at the ground, over teal and amber, to near white at the roofs; brightness rises all the
  // way, so that it reads in grey too.
  static const std::array<cv::Vec3f, 5> ramp{cv::Vec3f(135, 112, 98), cv::Vec3f(150, 125, 40),
                                             cv::Vec3f(110, 180, 90), cv::Vec3f(70, 200, 240),
                                             cv::Vec3f(215, 240, 255)};
  const float at = std::clamp(height, 0.0F, 1.0F) * static_cast<float>(ramp.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(at), ramp.size() - 2);
  const float share = at - static_cast<float>(below);
  return ramp.at(below) * (1.0F - share) + ramp.at(below + 1) * share;
}

cv::Mat draw_voxels(const MapSnapshot& view, const PictureFrame& frame) {
  cv::Mat3b picture(frame.size);
  picture.setTo(background());
  if (view.tiles.empty()) return picture;
  const TopView top = rasterize_top_view(view, frame);
  cv::Mat1b is_seen;
  cv::compare(top.rank_m, nothing, is_seen, cv::CMP_GT);
  const cv::Mat1f ground_m = ground_height(view, frame);
  const cv::Mat1f relief_m = relief(top.height_m, is_seen, frame.px_per_m);
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      if (is_seen(y, x) == 0) continue;
      picture(y, x) = shade(static_cast<SemanticClass>(top.label(y, x)),
                            top.height_m(y, x) - ground_m(y, x), relief_m(y, x));
    }
  }
  return picture;
}

}  // namespace stillmap
