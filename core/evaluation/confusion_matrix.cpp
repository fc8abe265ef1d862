#include "core/evaluation/confusion_matrix.hpp"

#include <numeric>
#include <stdexcept>
#include <string>

namespace stillmap::evaluation {
namespace {

std::size_t index(SemanticClass label) { return static_cast<std::size_t>(label); }

}  // namespace

void ConfusionMatrix::add(std::span<const SemanticClass> truth,
                          std::span<const SemanticClass> predicted) {
  if (truth.size() != predicted.size()) {
    throw std::invalid_argument("truth labels " + std::to_string(truth.size()) +
                                " points, the prediction " + std::to_string(predicted.size()));
  }
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (truth[i] != SemanticClass::unlabeled) counts_[index(truth[i])][index(predicted[i])] += 1;
  }
}

void ConfusionMatrix::add(const ConfusionMatrix& other) {
  for (std::size_t truth = 0; truth < semantic_class_count; ++truth) {
    for (std::size_t predicted = 0; predicted < semantic_class_count; ++predicted) {
      counts_[truth][predicted] += other.counts_[truth][predicted];
    }
  }
}

std::uint64_t ConfusionMatrix::count(SemanticClass truth, SemanticClass predicted) const {
  return counts_[index(truth)][index(predicted)];
}

std::uint64_t ConfusionMatrix::total() const {
  std::uint64_t sum = 0;
  for (const auto& row : counts_) sum = std::accumulate(row.begin(), row.end(), sum);
  return sum;
}

std::optional<double> ConfusionMatrix::iou(SemanticClass label) const {
  return iou(std::span(&label, 1));
}

std::optional<double> ConfusionMatrix::iou(std::span<const SemanticClass> group) const {
  std::uint64_t seen = 0, predicted = 0, hits = 0;
  for (const SemanticClass label : group) {
    const std::size_t k = index(label);
    for (std::size_t other = 0; other < semantic_class_count; ++other) {
      seen += counts_[k][other];
      predicted += counts_[other][k];
    }
    for (const SemanticClass other : group) hits += counts_[k][index(other)];
  }
  const std::uint64_t seen_or_predicted = seen + predicted - hits;
  if (seen_or_predicted == 0) return std::nullopt;
  return static_cast<double>(hits) / static_cast<double>(seen_or_predicted);
}

double ConfusionMatrix::mean_iou() const {
  double sum = 0.0;
  for (std::size_t k = 1; k < semantic_class_count; ++k) {
    sum += iou(static_cast<SemanticClass>(k)).value_or(0.0);
  }
  return sum / static_cast<double>(semantic_class_count - 1);
}

std::optional<double> ConfusionMatrix::mean_iou_of_present() const {
  double sum = 0.0;
  int present = 0;
  for (std::size_t k = 1; k < semantic_class_count; ++k) {
    const std::optional<double> of_class = iou(static_cast<SemanticClass>(k));
    sum += of_class.value_or(0.0);
    present += of_class.has_value() ? 1 : 0;
  }
  if (present == 0) return std::nullopt;
  return sum / present;
}

std::optional<double> ConfusionMatrix::accuracy() const {
  const std::uint64_t counted = total();
  if (counted == 0) return std::nullopt;
  std::uint64_t right = 0;
  for (std::size_t k = 0; k < semantic_class_count; ++k) right += counts_[k][k];
  return static_cast<double>(right) / static_cast<double>(counted);
}

namespace {

using enum SemanticClass;

constexpr std::array drivable{road, parking};
constexpr std::array other_ground_group{sidewalk, other_ground};
constexpr std::array structure{building, fence};
constexpr std::array vehicle{car, bicycle, motorcycle, truck, other_vehicle};
constexpr std::array people{person, bicyclist, motorcyclist};
constexpr std::array nature{vegetation, trunk, terrain};
constexpr std::array pole_like{pole, traffic_sign};

}  // namespace

std::array<ClassGroup, 7> coarse_groups() {
  return {{{"drivable", drivable},
           {"other ground", other_ground_group},
           {"structure", structure},
           {"vehicle", vehicle},
           {"person", people},
           {"nature", nature},
           {"pole-like", pole_like}}};
}

}  // namespace stillmap::evaluation
