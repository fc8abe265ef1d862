#pragma once

#include <filesystem>
#include <span>

#include "core/lidar/range_image.hpp"
#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// Classes of a scan's points as a range image in SemanticKITTI's colours, one strip for each entry
/// of `classes` (say, truth above prediction), each pixel its nearest point's. Empty pixels are
/// black. Throws std::runtime_error naming the file when it cannot be written.
void write_segmentation_picture(const std::filesystem::path& file, const RangeImage& image,
                                std::span<const std::span<const SemanticClass>> classes);

}  // namespace stillmap
