#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <string>
#include <vector>

#include "core/lidar/trajectory.hpp"
#include "core/map/tile.hpp"

namespace stillmap {

/// Where the map frame lies on a picture: x to the right, y up.
struct PictureFrame {
  /// Map position of the picture's lower left corner [m].
  Eigen::Vector2d corner_map = Eigen::Vector2d::Zero();
  double px_per_m = 1.0;
  cv::Size size;

  [[nodiscard]] cv::Point2d pixel(const Eigen::Vector2d& p_map) const {
    const Eigen::Vector2d p = (p_map - corner_map) * px_per_m;
    return {p.x(), size.height - p.y()};
  }
};

/// Round all voxels, in plan; empty for an empty map. Map frame [m].
[[nodiscard]] Eigen::AlignedBox2d xy_bounds(const MapSnapshot& view);

/// A picture with this box (map frame [m], not empty) in its middle, with a margin; its longest
/// side about `max_side_px`, and wide enough for a legend.
[[nodiscard]] PictureFrame fit_frame(const Eigen::AlignedBox2d& box_map, int max_side_px);

/// The background of all map pictures, BGR.
[[nodiscard]] cv::Scalar background();

/// Colours are BGR.
void draw_trajectory(cv::Mat& picture, const PictureFrame& frame, const Trajectory& trajectory,
                     const cv::Scalar& colour);

/// A ring at the start, a disc at the end.
void draw_ends(cv::Mat& picture, const PictureFrame& frame, const Trajectory& trajectory);

[[nodiscard]] cv::Scalar query_box_colour();
void draw_box(cv::Mat& picture, const PictureFrame& frame, const Eigen::AlignedBox3d& box_map);

/// A voxel's square round its mean, `min_px` wide at least.
void draw_voxel_square(cv::Mat& picture, const PictureFrame& frame, const Eigen::Vector3f& p_map,
                       double voxel_size_m, double min_px, const cv::Scalar& colour);

/// A bar of a round length (1, 2 or 5 times a power of ten metres) in the lower left corner.
void draw_scale_bar(cv::Mat& picture, double px_per_m);

struct LegendEntry {
  std::string text;
  cv::Scalar colour;
};

/// A strip as wide as the picture: a title line and the entries, as many rows as they need.
[[nodiscard]] cv::Mat draw_legend(int width_px, const std::string& title,
                                  const std::vector<LegendEntry>& entries);

/// Writes a picture of 8-bit blue, green, red (CV_8UC3). Throws std::runtime_error naming the file
/// when its name does not end in .png or it cannot be written.
void write_png(const std::filesystem::path& file, const cv::Mat& picture);

}  // namespace stillmap
