#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/segmentation/model_description.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// What make_network_input() gives of the same scan in a mirror, left for right: columns in the
/// other order, and y of the other sign. Pixels without a point stay so. `input`: channels x rows x
/// columns.
[[nodiscard]] std::vector<float> mirrored(std::span<const float> input, std::size_t columns,
                                          const InputStatistics& statistics);

/// The network's decision on what it finds in an image and in its mirror image, by the mean of both
/// probabilities: streets look alike both ways, and faults differ. Takes twice the time of
/// network.run().
[[nodiscard]] PixelOutputs run_mirrored_too(SegmentationNetwork& network,
                                            std::span<const float> input, std::size_t columns,
                                            const InputStatistics& statistics);

}  // namespace stillmap
