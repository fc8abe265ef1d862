#pragma once

#include <cstddef>
#include <span>

#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// What the last layer of a network gives.
enum class ScoreKind { probabilities, logits };

/// Probabilities when every pixel's scores lie in 0..1 and sum to 1, else logits. `scores` is
/// outputs x pixels.
[[nodiscard]] ScoreKind score_kind(std::span<const float> scores, std::size_t outputs);

/// The most probable output of each pixel (ties: the lowest) and its probability; of logits, the
/// soft-max. `scores` is outputs x pixels.
[[nodiscard]] PixelOutputs most_probable(std::span<const float> scores, std::size_t outputs,
                                         ScoreKind kind);

}  // namespace stillmap
