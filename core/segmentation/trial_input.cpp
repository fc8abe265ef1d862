#include "core/segmentation/trial_input.hpp"

#include <algorithm>
#include <cmath>

#include "core/segmentation/model_error.hpp"

namespace stillmap {

std::vector<float> trial_input(const ModelDescription& model) {
  std::vector<float> input(input_channels * static_cast<std::size_t>(model.rows) *
                           static_cast<std::size_t>(model.columns));
  for (std::size_t i = 0; i < input.size(); ++i)
    input[i] = std::sin(0.37F * static_cast<float>(i % 9973));
  return input;
}

void require_sound(const ModelDescription& model) {
  if (const std::string faults = model.faults(); !faults.empty()) {
    throw ModelError(model.network_file, "has a description that cannot be used:\n" + faults);
  }
}

void require_finite_scores(const ModelDescription& model, std::span<const float> scores) {
  if (std::ranges::all_of(scores, [](float score) { return std::isfinite(score); })) return;
  throw ModelError(model.network_file, "gives scores that are not finite numbers");
}

}  // namespace stillmap
