#pragma once

#include <opencv2/core/mat.hpp>

#include "core/map/tile.hpp"
#include "core/picture/picture_frame.hpp"

namespace stillmap {

/// The map's voxels from above as a BGR picture: the highest of each pixel, poles and signs before
/// all others.
[[nodiscard]] cv::Mat draw_voxels(const MapSnapshot& view, const PictureFrame& frame);

/// The background of all map pictures, BGR.
[[nodiscard]] cv::Scalar background();

/// Colour of a class on the picture, BGR: SemanticKITTI's, dimmed on the ground, so that what
/// stands on it comes out.
[[nodiscard]] cv::Vec3f class_colour(SemanticClass label);

/// Colour of a voxel without class, BGR, by its height above the ground: 0 at the ground to 1 at
/// roof height.
[[nodiscard]] cv::Vec3f height_colour(float height);

}  // namespace stillmap
