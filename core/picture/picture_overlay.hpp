#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "core/lidar/trajectory.hpp"
#include "core/picture/picture_frame.hpp"

namespace stillmap {

/// What is drawn over the map and below it. Colours are BGR.
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

}  // namespace stillmap
