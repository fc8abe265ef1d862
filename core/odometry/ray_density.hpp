#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <numbers>
#include <span>

namespace stillmap {

/// Rays by their elevation, as if they went all round: no more than there are. The rings of many
/// lidars lie closer together at the horizon than below it.
class RayDensity {
 public:
  explicit RayDensity(std::span<const Eigen::Vector3f> points_lidar) {
    constexpr std::size_t one_of = 7;
    std::array<std::size_t, bins> counts{};
    for (std::size_t i = 0; i < points_lidar.size(); i += one_of)
      counts[bin_of(points_lidar[i])] += one_of;
    for (std::size_t bin = 0; bin < bins; ++bin) {
      const std::size_t first = bin == 0 ? 0 : bin - 1;
      const std::size_t last = std::min(bin + 1, bins - 1);
      std::size_t count = 0;
      for (std::size_t k = first; k <= last; ++k) count += counts[k];
      const float steradians =
          2.0F * std::numbers::pi_v<float> * bin_sine * static_cast<float>(last - first + 1);
      per_steradian_[bin] = static_cast<float>(count) / steradians;
      most_per_steradian_ = std::max(most_per_steradian_, per_steradian_[bin]);
    }
  }

  /// Counts rays into the sky, too, of which only those come back that meet something in the air:
  /// as many as meet the ground on average.
  void count_sky() {
    float sum = 0.0F;
    float filled = 0.0F;
    for (std::size_t bin = 0; bin < bins / 2; ++bin) {
      sum += per_steradian_[bin];
      filled += per_steradian_[bin] > 0.0F ? 1.0F : 0.0F;
    }
    const float mean = sum / std::max(filled, 1.0F);
    for (std::size_t bin = bins / 2; bin < bins; ++bin)
      if (per_steradian_[bin] > 0.0F) per_steradian_[bin] = std::max(per_steradian_[bin], mean);
    most_per_steradian_ = std::max(most_per_steradian_, mean);
  }

  [[nodiscard]] float per_steradian(const Eigen::Vector3f& point_lidar) const {
    return per_steradian_[bin_of(point_lidar)];
  }
  [[nodiscard]] float most_per_steradian() const { return most_per_steradian_; }

 private:
  static constexpr std::size_t bins = 50;
  static constexpr float bin_sine = 2.0F / static_cast<float>(bins);
  static std::size_t bin_of(const Eigen::Vector3f& point) {
    const float sine = point.z() / std::max(point.norm(), 1e-3F);
    return std::min(static_cast<std::size_t>(std::max(sine + 1.0F, 0.0F) / bin_sine), bins - 1);
  }
  std::array<float, bins> per_steradian_{};
  float most_per_steradian_ = 0.0F;
};

}  // namespace stillmap
