#include "core/picture/map_picture.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "core/map/voxel_grid.hpp"
#include "core/picture/map_canvas.hpp"

namespace stillmap {
namespace {

constexpr float roof_height_m = 8.0F;
constexpr float nothing = -1e9F;

/// Of every pixel, what is seen from above.
struct PixelView {
  cv::Mat1f height_m;
  /// Height by which pixels compete: that of poles and signs is raised.
  cv::Mat1f rank_m;
  cv::Mat1b label;
};

bool is_drawn_on_top(SemanticClass label) {
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

PixelView rasterize(const MapSnapshot& view, const PictureFrame& frame) {
  PixelView top{cv::Mat1f(frame.size, nothing), cv::Mat1f(frame.size, nothing),
                cv::Mat1b(frame.size, 0)};
  const VoxelGrid grid(view.voxel_size_m, view.tile_size_m);
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      const SemanticClass label = voxel.evidence.winner();
      const float rank_m = voxel.mean_map.z() + (is_drawn_on_top(label) ? 1000.0F : 0.0F);
      const cv::Rect cell = pixels_of(grid.corner_map(tile->info.id, voxel.index),
                                      view.voxel_size_m, frame, is_drawn_on_top(label) ? 3 : 1);
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

/// Colour of a class on the picture, BGR: SemanticKITTI's, dimmed on the ground, so that what
/// stands on it comes out.
cv::Vec3f class_colour(SemanticClass label) {
  const Rgb rgb = colour(label);
  const cv::Vec3f bgr(rgb.b, rgb.g, rgb.r);
  // Dimmed, but never down to the background: a sidewalk's own colour is nearly black.
  return is_ground(label) ? bgr * 0.5F + cv::Vec3f::all(38.0F) : bgr;
}

/// Colour of a voxel without class, BGR, by its height above the ground: 0 at the ground to 1 at
/// roof height.
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

/// Colour and brightness of one pixel.
cv::Vec3b shade(SemanticClass label, float above_ground_m, float relief_m) {
  const float height = std::clamp(above_ground_m / roof_height_m, 0.0F, 1.0F);
  const cv::Vec3f colour =
      label == SemanticClass::unlabeled ? height_colour(height) : class_colour(label);
  const float edge = std::clamp(1.0F + (is_ground(label) ? 3.0F : 0.25F) * relief_m, 0.6F, 1.5F);
  const float lift = is_ground(label) || is_drawn_on_top(label) ? 1.0F : 0.7F + 0.35F * height;
  const cv::Vec3f lit = colour * (edge * lift);
  return {cv::saturate_cast<std::uint8_t>(lit[0]), cv::saturate_cast<std::uint8_t>(lit[1]),
          cv::saturate_cast<std::uint8_t>(lit[2])};
}

/// The map's voxels from above as a BGR picture: the highest of each pixel, poles and signs before
/// all others.
cv::Mat draw_voxels(const MapSnapshot& view, const PictureFrame& frame) {
  cv::Mat3b picture(frame.size);
  picture.setTo(background());
  if (view.tiles.empty()) return picture;
  const PixelView top = rasterize(view, frame);
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

const cv::Scalar estimate_colour(255, 255, 255);
const cv::Scalar truth_colour(255, 210, 60);

const cv::Scalar closure_colour(70, 90, 255);

/// Lines between the poses that closures join, with a dot at each end.
void draw_closures(cv::Mat& picture, const PictureFrame& frame, const Trajectory& estimate,
                   const MapPictureOptions& options) {
  constexpr int radius_px = 4;
  const auto pixel_of = [&](std::size_t pose) -> cv::Point {
    return frame.pixel(estimate.at(pose).T_map_lidar.translation().head<2>());
  };
  for (const auto& [from, to] : options.closures) {
    cv::line(picture, pixel_of(from), pixel_of(to), closure_colour, 2, cv::LINE_AA);
    cv::circle(picture, pixel_of(from), radius_px, closure_colour, 1, cv::LINE_AA);
    cv::circle(picture, pixel_of(to), radius_px, closure_colour, cv::FILLED, cv::LINE_AA);
  }
}

/// A disc where the lidar was, and a line to where it looked.
void draw_places(cv::Mat& picture, const PictureFrame& frame, const Trajectory& places) {
  constexpr double radius_px = 6.0, line_px = 18.0;
  for (const StampedPose& place : places) {
    if (!place.T_map_lidar.matrix().allFinite()) continue;
    const cv::Point2d centre = frame.pixel(place.T_map_lidar.translation().head<2>());
    const Eigen::Vector2d ahead = place.T_map_lidar.linear().col(0).head<2>();
    const cv::Point2d tip = centre + line_px * cv::Point2d(ahead.x(), -ahead.y());
    for (const double casing_px : {2.0, 0.0}) {
      const cv::Scalar colour = casing_px > 0.0 ? cv::Scalar(0, 0, 0) : estimate_colour;
      cv::line(picture, centre, tip, colour, 2 + cvRound(2.0 * casing_px), cv::LINE_AA);
      cv::circle(picture, centre, cvRound(radius_px + casing_px), colour, cv::FILLED, cv::LINE_AA);
    }
  }
}

Eigen::AlignedBox2d extent(const MapSnapshot& view, const Trajectory& estimate,
                           const MapPictureOptions& options) {
  Eigen::AlignedBox2d box = xy_bounds(view);
  const auto extend_by = [&box](const Trajectory& trajectory) {
    for (const StampedPose& pose : trajectory) {
      const Eigen::Vector2d p = pose.T_map_lidar.translation().head<2>();
      if (p.allFinite()) box.extend(p);
    }
  };
  extend_by(estimate);
  if (options.truth) extend_by(*options.truth);
  if (box.isEmpty()) box.extend(Eigen::Vector2d::Zero());
  return box;
}

double length_m(const Trajectory& trajectory) {
  double length = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    length +=
        (trajectory[i].T_map_lidar.translation() - trajectory[i - 1].T_map_lidar.translation())
            .norm();
  }
  return length;
}

std::string with_thousands(std::size_t number) {
  const std::string digits = std::to_string(number);
  std::string grouped;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) grouped.push_back(',');
    grouped.push_back(digits[i]);
  }
  return grouped;
}

using ClassCounts = std::array<std::size_t, semantic_class_count>;

ClassCounts count_classes(const MapSnapshot& view) {
  ClassCounts counts{};
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      ++counts.at(static_cast<std::size_t>(voxel.evidence.winner()));
    }
  }
  return counts;
}

std::string title(const MapSnapshot& view, const Trajectory& estimate,
                  const MapPictureOptions& options) {
  if (view.tiles.empty()) return "The map is empty.";
  std::ostringstream text;
  text << with_thousands(view.tiles.voxel_count()) << " voxels of " << view.voxel_size_m << " m in "
       << view.tiles.size() << " tiles";
  if (options.looked_for) {
    text << ", " << estimate.size() << " of " << *options.looked_for << " found";
  } else if (!estimate.empty()) {
    text << ", " << std::fixed << std::setprecision(0) << length_m(estimate) << " m driven";
  }
  return text.str();
}

std::vector<LegendEntry> legend_entries(const MapSnapshot& view, const Trajectory& estimate,
                                        const MapPictureOptions& options) {
  std::vector<LegendEntry> entries;
  if (!estimate.empty())
    entries.push_back({options.looked_for ? "found" : "trajectory", estimate_colour});
  if (options.truth) entries.push_back({"truth", truth_colour});
  if (!options.closures.empty()) entries.push_back({"closed loop", closure_colour});
  if (options.query_box_map) entries.push_back({"query", query_box_colour()});
  const ClassCounts counts = count_classes(view);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts.at(i) == 0) continue;
    const auto label = static_cast<SemanticClass>(i);
    const bool has_class = label != SemanticClass::unlabeled;
    const cv::Vec3f colour = has_class ? class_colour(label) : height_colour(0.6F);
    entries.push_back({std::string(has_class ? name(label) : "no class (colour by height)"),
                       cv::Scalar(colour[0], colour[1], colour[2])});
  }
  return entries;
}

}  // namespace

void write_map_picture(const std::filesystem::path& file, const MapSnapshot& view,
                       const Trajectory& estimate, const MapPictureOptions& options) {
  const PictureFrame frame = fit_frame(extent(view, estimate, options), options.max_side_px);
  cv::Mat picture = draw_voxels(view, frame);
  if (options.query_box_map) draw_box(picture, frame, *options.query_box_map);
  if (options.truth) draw_trajectory(picture, frame, *options.truth, truth_colour);
  if (options.looked_for) {
    draw_places(picture, frame, estimate);
  } else {
    draw_trajectory(picture, frame, estimate, estimate_colour);
    draw_closures(picture, frame, estimate, options);
    draw_ends(picture, frame, estimate);
  }
  draw_scale_bar(picture, frame.px_per_m);

  cv::vconcat(picture,
              draw_legend(picture.cols, title(view, estimate, options),
                          legend_entries(view, estimate, options)),
              picture);
  write_png(file, picture);
}

}  // namespace stillmap
