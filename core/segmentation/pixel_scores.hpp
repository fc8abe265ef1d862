#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// Output of a network's last layer.
enum class ScoreKind { probabilities, logits };

/// Memory layout of an image's scores: outputs x pixels, or pixels x outputs.
enum class ScoreLayout { planes, pixels };

/// Probabilities when every pixel's scores lie in 0..1 and sum to 1, else logits.
[[nodiscard]] ScoreKind score_kind(std::span<const float> scores, std::size_t outputs,
                                   ScoreLayout layout = ScoreLayout::planes);

/// The most probable output of each pixel (ties: the lowest) and its probability; of logits, the
/// soft-max.
[[nodiscard]] PixelOutputs argmax_outputs(std::span<const float> scores, std::size_t outputs,
                                          ScoreKind kind, ScoreLayout layout = ScoreLayout::planes);

/// The probabilities, outputs x pixels.
[[nodiscard]] std::vector<float> probabilities_of(std::span<const float> scores,
                                                  std::size_t outputs, ScoreKind kind,
                                                  ScoreLayout layout = ScoreLayout::planes);

}  // namespace stillmap
