#include "core/evaluation/traversability_score.hpp"

#include <numeric>

namespace stillmap::evaluation {
namespace {

FalseFree cause_of(const TraversabilityCell& cell, const CellTruth& truth) {
  if (truth.is_removed_vehicle) return FalseFree::removed_vehicle;
  if (truth.is_edge && truth.reason != BlockReason::obstacle) return FalseFree::edge;
  if (cell.inferred) return FalseFree::inferred;
  if (truth.reason == BlockReason::step) return FalseFree::step;
  return truth.reason == BlockReason::ground_class ? FalseFree::ground_class : FalseFree::obstacle;
}

void count(TraversabilityScore& score, const TraversabilityCell& cell, const CellTruth& truth) {
  const bool is_truly_free = truth.reason == BlockReason::none;
  if (cell.is_lethal_itself()) {
    if (is_truly_free) {
      ++score.false_lethal.at(static_cast<std::size_t>(cell.reason));
    } else {
      ++score.lethal_and_truly_lethal;
    }
  } else if (is_truly_free) {
    ++score.free_and_truly_free;
  } else {
    ++score.false_free.at(static_cast<std::size_t>(cause_of(cell, truth)));
  }
}

std::optional<double> share(std::uint64_t part, std::uint64_t rest) {
  if (part + rest == 0) return std::nullopt;
  return static_cast<double>(part) / static_cast<double>(part + rest);
}

}  // namespace

std::string_view name(FalseFree cause) {
  constexpr std::array<std::string_view, false_free_count> names{
      "removed vehicle", "edge of the ground", "inferred ground", "obstacle", "step", "class"};
  return names.at(static_cast<std::size_t>(cause));
}

std::uint64_t TraversabilityScore::all_false_free() const {
  return std::accumulate(false_free.begin(), false_free.end(), std::uint64_t{0});
}

std::uint64_t TraversabilityScore::all_false_lethal() const {
  return std::accumulate(false_lethal.begin(), false_lethal.end(), std::uint64_t{0});
}

std::optional<double> TraversabilityScore::precision(bool without_vehicles) const {
  const std::uint64_t vehicles =
      false_free.at(static_cast<std::size_t>(FalseFree::removed_vehicle));
  if (!without_vehicles) return share(free_and_truly_free, all_false_free());
  return share(free_and_truly_free + vehicles, all_false_free() - vehicles);
}

std::optional<double> TraversabilityScore::recall() const {
  return share(free_and_truly_free, all_false_lethal());
}

TraversabilityScore score_traversability(const TraversabilityView& view,
                                         const TraversabilityTruth& truth) {
  TraversabilityScore score;
  for (const auto& tile : view.tiles) {
    for (int y = 0; y < tile->side; ++y) {
      for (int x = 0; x < tile->side; ++x) {
        const TraversabilityCell& cell = tile->at(x, y);
        if (cell.state == CellState::unknown) continue;
        Eigen::Vector3d ground_map;
        ground_map << view.centre_of({tile->id.x * tile->side + x, tile->id.y * tile->side + y}),
            static_cast<double>(tile->surface->at(x, y).cell->ground.height_m);
        count(score, cell, truth(ground_map));
      }
    }
  }
  return score;
}

}  // namespace stillmap::evaluation
