#pragma once

#include <span>
#include <vector>

#include "core/lidar/range_image.hpp"
#include "core/lidar/scan.hpp"
#include "core/segmentation/model_description.hpp"

namespace stillmap {

/// The network's input, channels x rows x columns: range, x, y, z, remission of each pixel's
/// nearest point and, for models that take it, the slope of the surface there, as (value - mean) /
/// deviation; all 0 in an empty pixel. Without intensity, or with one that is the same everywhere,
/// the remission is 0, the mean. An intensity whose 90th percentile is beyond a factor of 3 of the
/// training set's is scaled to it and cut at 1; within a factor of 1.2 it stays, and between them
/// both are done in part. `image` is the scan's.
[[nodiscard]] std::vector<float> make_network_input(const Scan& scan, const RangeImage& image,
                                                    const ModelDescription& model);
/// The same of a scan whose points are turned to other axes; `image` is that of the scan as it was
/// or of the turned points. `raised_m` is added to z.
[[nodiscard]] std::vector<float> make_network_input(std::span<const Eigen::Vector3f> points,
                                                    std::span<const float> intensity,
                                                    const RangeImage& image,
                                                    const ModelDescription& model,
                                                    float raised_m = 0.0F);

/// A synthetic input with values of both signs that differ from pixel to pixel, for a trial run of
/// a network when it is loaded.
[[nodiscard]] std::vector<float> trial_input(const ModelDescription& model);

/// Throws ModelError when the trial run gave scores that are not finite.
void require_finite_scores(const ModelDescription& model, std::span<const float> scores);

}  // namespace stillmap
