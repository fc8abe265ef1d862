#pragma once

#include <span>
#include <vector>

#include "core/segmentation/model_description.hpp"

namespace stillmap {

/// An image of plausible values for the model: numbers of both signs that differ from pixel to
/// pixel. Engines try a network with it before they take it.
[[nodiscard]] std::vector<float> trial_input(const ModelDescription& model);

/// Throws ModelError when the description has faults.
void require_sound(const ModelDescription& model);

/// Throws ModelError when a trial gave scores that are not finite.
void require_finite_scores(const ModelDescription& model, std::span<const float> scores);

}  // namespace stillmap
