#pragma once

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

}  // namespace stillmap
