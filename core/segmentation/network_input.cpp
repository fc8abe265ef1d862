#include "core/segmentation/network_input.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <optional>

#include "core/lidar/ranked_value.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/surface_slope.hpp"

namespace stillmap {
namespace {

/// How a scan's intensity is brought towards the scale of the training set. A lidar may lie
/// anywhere between the two scales, and from scan to scan on either side of any step: it goes over
/// steadily.
class RemissionScale {
 public:
  /// `factor` would bring the scan to the usual brightness. Nothing of one is applied that scans of
  /// the training set's own lidar may need, all of one that only another scale needs, and between
  /// them the more the greater it is.
  explicit RemissionScale(float factor)
      : share_(std::clamp(std::log(std::max(factor, 1.0F / factor) / usual_factor) /
                              std::log(other_scale_factor / usual_factor),
                          0.0F, 1.0F)),
        factor_(std::pow(factor, share_)) {}

  /// Of another scale, retro-reflectors would be brighter than anything that was learned: they are
  /// cut there, by the same share between, and not where nothing is applied. NaN stays.
  [[nodiscard]] float applied_to(float intensity) const {
    const float scaled = factor_ * intensity;
    return scaled > max_remission ? max_remission * std::pow(scaled / max_remission, 1.0F - share_)
                                  : scaled;
  }

 private:
  static constexpr float usual_factor = 1.2F, other_scale_factor = 3.0F;
  /// Scans of the usual scale have no more.
  static constexpr float max_remission = 1.0F;

  float share_;
  float factor_;
};

/// The scale of a scan's intensity, told by its bright points. Nothing where all points are alike,
/// as where a driver fills the field with zeros: it tells nothing.
std::optional<RemissionScale> remission_scale(std::span<const float> intensity,
                                              const InputStatistics& statistics) {
  constexpr std::size_t samples = 4096, min_points = 1000;
  if (intensity.empty()) return std::nullopt;
  if (intensity.size() < min_points) return RemissionScale(1.0F);
  std::vector<float> sample;
  const std::size_t step = intensity.size() / samples + 1;
  for (std::size_t i = 0; i < intensity.size(); i += step)
    if (std::isfinite(intensity[i])) sample.push_back(intensity[i]);
  if (sample.empty()) return std::nullopt;
  const float dark = ranked_value(sample, (sample.size() - 1) * 10 / 100);
  const float bright = ranked_value(sample, (sample.size() - 1) * 90 / 100);
  if (bright <= dark || bright <= 0.0F) return std::nullopt;
  // The same share of a normal distribution.
  constexpr std::size_t remission = index(InputChannel::remission);
  const float usual = statistics.mean[remission] + 1.28F * statistics.deviation[remission];
  return RemissionScale(usual > 0.0F ? usual / bright : 1.0F);
}

}  // namespace

std::vector<float> make_network_input(const Scan& scan, const RangeImage& image,
                                      const ModelDescription& model) {
  return make_network_input(scan.points_lidar, scan.intensity, image, model);
}

std::vector<float> make_network_input(std::span<const Eigen::Vector3f> points,
                                      std::span<const float> intensity, const RangeImage& image,
                                      const ModelDescription& model, float raised_m) {
  assert(image.point_count() == points.size());
  assert(intensity.empty() || intensity.size() == points.size());
  const std::size_t pixels = image.pixel_count();
  const InputStatistics& statistics = model.statistics;
  const std::optional<RemissionScale> scale = remission_scale(intensity, statistics);
  const bool has_slope = statistics.channels > index(InputChannel::slope);
  const std::vector<float> slope_rad =
      has_slope ? surface_slope_rad(image, points) : std::vector<float>();
  std::vector<float> input(statistics.channels * pixels, 0.0F);
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    const std::int32_t nearest = image.nearest()[pixel];
    if (nearest == RangeImage::none || (model.mask_first_point && nearest == 0)) continue;
    const auto point = static_cast<std::size_t>(nearest);
    const Eigen::Vector3f& p = points[point];
    const float remission = scale ? scale->applied_to(intensity[point])
                                  : statistics.mean[index(InputChannel::remission)];
    const std::array<float, max_input_channels> values{
        image.range_m()[pixel], p.x(),     p.y(),
        p.z() + raised_m,       remission, has_slope ? slope_rad[pixel] : 0.0F};
    for (std::size_t c = 0; c < statistics.channels; ++c) {
      const float normalised = (values[c] - statistics.mean[c]) / statistics.deviation[c];
      // Only remission can be NaN here; convolutions would spread it to the surroundings.
      if (std::isfinite(normalised)) input[c * pixels + pixel] = normalised;
    }
  }
  return input;
}

std::vector<float> trial_input(const ModelDescription& model) {
  std::vector<float> input(model.input_size());
  for (std::size_t i = 0; i < input.size(); ++i)
    input[i] = std::sin(0.37F * static_cast<float>(i % 9973));
  return input;
}

void require_finite_scores(const ModelDescription& model, std::span<const float> scores) {
  if (std::ranges::all_of(scores, [](float score) { return std::isfinite(score); })) return;
  throw ModelError(model.network_file, "gives scores that are not finite numbers");
}

}  // namespace stillmap
