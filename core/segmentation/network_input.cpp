#include "core/segmentation/network_input.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "core/segmentation/model_error.hpp"

namespace stillmap {

std::vector<float> make_network_input(const Scan& scan, const RangeImage& image,
                                      const ModelDescription& model) {
  assert(image.point_count() == scan.size());
  assert(scan.intensity.empty() || scan.intensity.size() == scan.size());
  const std::size_t pixels = image.pixel_count();
  const InputStatistics& statistics = model.statistics;
  std::vector<float> input(input_channels * pixels, 0.0F);
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    const std::int32_t nearest = image.nearest()[pixel];
    if (nearest == RangeImage::none || (model.mask_first_point && nearest == 0)) continue;
    const auto point = static_cast<std::size_t>(nearest);
    const Eigen::Vector3f& p_lidar = scan.points_lidar[point];
    const float remission = scan.intensity.empty() ? statistics.mean.back() : scan.intensity[point];
    const std::array<float, input_channels> values{image.range_m()[pixel], p_lidar.x(), p_lidar.y(),
                                                   p_lidar.z(), remission};
    for (std::size_t c = 0; c < input_channels; ++c) {
      const float normalised = (values[c] - statistics.mean[c]) / statistics.deviation[c];
      // Only remission can be NaN here; convolutions would spread it to the surroundings.
      if (std::isfinite(normalised)) input[c * pixels + pixel] = normalised;
    }
  }
  return input;
}

std::vector<float> trial_input(const ModelDescription& model) {
  std::vector<float> input(input_channels * static_cast<std::size_t>(model.rows) *
                           static_cast<std::size_t>(model.columns));
  for (std::size_t i = 0; i < input.size(); ++i)
    input[i] = std::sin(0.37F * static_cast<float>(i % 9973));
  return input;
}

void require_finite_scores(const ModelDescription& model, std::span<const float> scores) {
  if (std::ranges::all_of(scores, [](float score) { return std::isfinite(score); })) return;
  throw ModelError(model.network_file, "gives scores that are not finite numbers");
}

}  // namespace stillmap
