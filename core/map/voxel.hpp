#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// A voxel's place in its tile: column and row from the tile's corner, layer from map height 0.
struct VoxelIndex {
  std::uint16_t x = 0;
  std::uint16_t y = 0;
  std::int16_t z = 0;
  friend auto operator<=>(const VoxelIndex&, const VoxelIndex&) = default;
};

/// Column, row and layer in 32 bits; keys sort as indices do. Columns and rows are below 256.
[[nodiscard]] constexpr std::uint32_t voxel_key(VoxelIndex index) {
  return std::uint32_t{index.x} << 24 | std::uint32_t{index.y} << 16 |
         (static_cast<std::uint16_t>(index.z) ^ 0x8000U);
}
[[nodiscard]] constexpr VoxelIndex voxel_index(std::uint32_t key) {
  return {static_cast<std::uint16_t>(key >> 24), static_cast<std::uint16_t>(key >> 16 & 0xFFU),
          static_cast<std::int16_t>((key & 0xFFFFU) ^ 0x8000U)};
}

/// Votes for the classes of a voxel, in eight bytes. Only the strongest few are kept: the size is
/// bounded, and the winner can still change.
class ClassEvidence {
 public:
  /// Adds `weight` (a confidence, 0..1) for `label`, which replaces the weakest candidate when it
  /// is none yet. `unlabeled` and weights that are not positive are ignored.
  void add(SemanticClass label, float weight);
  /// The same of several votes for `label` that count so many steps together (steps_of_vote), where
  /// none of them would scale the votes down; false, and nothing is added, where one would.
  [[nodiscard]] bool add_at_once(SemanticClass label, std::uint32_t steps);
  /// How many steps a vote of this weight counts; none of one that is ignored.
  [[nodiscard]] static std::uint32_t steps_of_vote(float weight) {
    if (!(weight > 0.0F)) return 0;
    // Rounded without the library's call: every point of a scan comes here.
    constexpr float parts_per_weight = 1.0F / (vote_steps * weight_step);
    const int parts = static_cast<int>(std::min(weight, 1.0F) * parts_per_weight + 0.5F);
    return static_cast<std::uint32_t>(std::max(1, parts * vote_steps));
  }
  /// The class with most evidence, `unlabeled` without any.
  [[nodiscard]] SemanticClass winner() const {
    const std::size_t best = strongest();
    return bits_.weights[best] > 0 ? label(best) : SemanticClass::unlabeled;
  }
  /// The winner's share of all evidence kept, 0..1.
  [[nodiscard]] float share() const {
    const std::uint32_t all = total();
    return all == 0 ? 0.0F
                    : static_cast<float>(bits_.weights[strongest()]) / static_cast<float>(all);
  }

  /// Whether there is a winner, and with a mean confidence of 0.7 over the voxel's points.
  [[nodiscard]] bool is_sure(std::uint32_t points) const {
    constexpr float sure_confidence = 0.7F;
    // Of more points votes are scaled down.
    constexpr float max_points = 0.75F * max_total;
    const float weight = static_cast<float>(bits_.weights[strongest()]) * weight_step;
    return weight > 0.0F &&
           weight >= sure_confidence * std::min(static_cast<float>(points), max_points);
  }

  struct Vote {
    SemanticClass label = SemanticClass::unlabeled;
    float weight = 0.0F;
    friend bool operator==(const Vote&, const Vote&) = default;
  };
  static constexpr std::size_t candidates = 3;
  /// The votes are scaled down to this total: however long a voxel was seen as one class, max_total
  /// * ln 2 = 139 confident votes in a row for another one turn it (some ten scans of a lidar
  /// nearby).
  static constexpr float max_total = 200.0F;
  /// Weights are whole numbers of these steps; a vote counts one at least.
  static constexpr float weight_step = 1.0F / 128.0F;
  /// A vote is rounded to whole numbers of so many steps: finer ones tell no more, and take more
  /// room on disk.
  static constexpr int vote_steps = 8;
  /// A vote of confidence 1, and the greatest total, in steps.
  static constexpr std::uint32_t confident_steps = static_cast<std::uint32_t>(1.0F / weight_step);
  static constexpr std::uint32_t max_steps = static_cast<std::uint32_t>(max_total / weight_step);
  [[nodiscard]] std::array<Vote, candidates> votes() const;
  /// Of these votes, rounded to steps such that the winner stays. Weights are 0 to 2 * max_total.
  [[nodiscard]] static ClassEvidence of(const std::array<Vote, candidates>& votes);

  /// As it lies in memory and is stored.
  struct Bits {
    /// In steps.
    std::array<std::uint16_t, candidates> weights{};
    /// Five bits a class, the first one's lowest.
    std::uint16_t classes = 0;
    friend bool operator==(const Bits&, const Bits&) = default;
  };
  [[nodiscard]] const Bits& bits() const { return bits_; }
  /// Nothing for bits that no votes lead to.
  [[nodiscard]] static std::optional<ClassEvidence> of(const Bits& bits) {
    ClassEvidence evidence;
    evidence.bits_ = bits;
    return evidence.is_possible() ? std::optional(evidence) : std::nullopt;
  }

  friend bool operator==(const ClassEvidence&, const ClassEvidence&) = default;

 private:
  static constexpr int class_bits = 5;
  static constexpr std::uint16_t class_mask = (1U << class_bits) - 1;

  [[nodiscard]] SemanticClass label(std::size_t i) const {
    return static_cast<SemanticClass>(bits_.classes >> (class_bits * static_cast<int>(i)) &
                                      class_mask);
  }
  void set_label(std::size_t i, SemanticClass label);
  /// To the candidate of this label, made where there is none.
  void add_steps(SemanticClass label, std::uint32_t steps);
  [[nodiscard]] std::uint32_t total() const {
    return std::uint32_t{bits_.weights[0]} + bits_.weights[1] + bits_.weights[2];
  }
  /// Of equal votes that of the lower class, so that the order of votes does not matter.
  [[nodiscard]] std::size_t strongest() const {
    std::size_t best = 0;
    for (std::size_t i = 1; i < candidates; ++i) {
      const auto weight = bits_.weights[i];
      const auto most = bits_.weights[best];
      if (weight > most || (weight == most && label(i) < label(best))) best = i;
    }
    return best;
  }
  [[nodiscard]] bool is_possible() const {
    static_assert(candidates == 3);
    const auto is_class = [&](std::size_t i) {
      return static_cast<std::size_t>(label(i)) < semantic_class_count;
    };
    // Rounding adds a little to the greatest total.
    return total() <= max_steps + candidates && (bits_.classes >> (class_bits * candidates)) == 0 &&
           is_class(0) && is_class(1) && is_class(2);
  }
  /// To the greatest total, where it is exceeded.
  void scale_down();

  Bits bits_;
};

struct Voxel {
  VoxelIndex index;
  /// Up to 65,535: that many or more.
  std::uint32_t point_count = 0;
  /// Mean of the points seen in it, map frame [m].
  Eigen::Vector3f mean_map = Eigen::Vector3f::Zero();
  ClassEvidence evidence;
  std::int64_t first_seen_ns = 0;
  std::int64_t last_seen_ns = 0;
};

}  // namespace stillmap
