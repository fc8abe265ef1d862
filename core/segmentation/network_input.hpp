#pragma once

#include <span>
#include <vector>

#include "core/lidar/range_image.hpp"
#include "core/lidar/scan.hpp"
#include "core/segmentation/model_description.hpp"

namespace stillmap {

/// The network's input, 5 x rows x columns: range, x, y, z, remission of each pixel's nearest
/// point, (value - mean) / deviation; all 0 where a pixel is empty. A scan without intensity gives
/// the mean remission, 0. `image` is the scan's.
[[nodiscard]] std::vector<float> make_network_input(const Scan& scan, const RangeImage& image,
                                                    const ModelDescription& model);

/// An image of plausible values for the model: numbers of both signs that differ from pixel to
/// pixel. Engines try a network with it before they take it.
[[nodiscard]] std::vector<float> trial_input(const ModelDescription& model);

/// Throws ModelError when the description has faults.
void require_sound(const ModelDescription& model);

/// Throws ModelError when a trial gave scores that are not finite.
void require_finite_scores(const ModelDescription& model, std::span<const float> scores);

}  // namespace stillmap
