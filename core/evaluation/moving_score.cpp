#include "core/evaluation/moving_score.hpp"

#include <stdexcept>
#include <string>

#include "core/lidar/semantic_class.hpp"

namespace stillmap::evaluation {
namespace {

constexpr std::uint16_t outlier_id = 1;

std::optional<double> ratio(std::uint64_t part, std::uint64_t whole) {
  if (whole == 0) return std::nullopt;
  return static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace

std::optional<double> MovingScore::precision() const {
  return ratio(true_positives, true_positives + false_positives);
}

std::optional<double> MovingScore::recall() const {
  return ratio(true_positives, true_positives + false_negatives);
}

std::optional<double> MovingScore::iou() const {
  return ratio(true_positives, true_positives + false_positives + false_negatives);
}

MovingScore& MovingScore::operator+=(const MovingScore& other) {
  true_positives += other.true_positives;
  false_positives += other.false_positives;
  false_negatives += other.false_negatives;
  return *this;
}

MovingScore moving_score(std::span<const Motion> motion,
                         std::span<const std::uint16_t> original_ids) {
  if (motion.size() != original_ids.size()) {
    throw std::invalid_argument("motion of " + std::to_string(motion.size()) + " points and " +
                                std::to_string(original_ids.size()) + " true labels");
  }
  MovingScore score;
  for (std::size_t i = 0; i < motion.size(); ++i) {
    if (original_ids[i] <= outlier_id) continue;
    const bool moves = is_moving_semantic_kitti(original_ids[i]);
    const bool found = motion[i] == Motion::highly_dynamic;
    score.true_positives += moves && found ? 1 : 0;
    score.false_positives += !moves && found ? 1 : 0;
    score.false_negatives += moves && !found ? 1 : 0;
  }
  return score;
}

}  // namespace stillmap::evaluation
