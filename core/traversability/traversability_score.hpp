#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>

#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// What a cell truly is for the robot of an area.
struct CellTruth {
  /// `none` where the robot may be.
  BlockReason reason = BlockReason::none;
  /// It is blocked only by a vehicle that stood there and is not part of a static map.
  bool is_removed_vehicle = false;
  /// Beside an edge of the ground, or between two classes of it.
  bool is_edge = false;
};

/// The truth at a point on the ground, map frame [m].
using TraversabilityTruth = std::function<CellTruth(const Eigen::Vector3d& ground_map)>;

/// Why a cell was called free that is not. The first that fits.
enum class FalseFree : std::uint8_t {
  /// A parked vehicle stood there; the static map leaves it out on purpose.
  removed_vehicle,
  /// The cell touches an edge, and was given to its other side.
  edge,
  /// The ground was not seen but inferred.
  inferred,
  obstacle,
  step,
  ground_class,
};
inline constexpr std::size_t false_free_count = 6;

[[nodiscard]] std::string_view name(FalseFree cause);

/// An area held against the truth, cell by cell, over the cells that are not unknown. A cell of
/// the safety margin counts by what it is in itself: free.
struct TraversabilityScore {
  std::uint64_t free_and_truly_free = 0;
  std::uint64_t lethal_and_truly_lethal = 0;
  /// Called lethal, by the reason given.
  std::array<std::uint64_t, block_reason_count> false_lethal{};
  std::array<std::uint64_t, false_free_count> false_free{};

  [[nodiscard]] std::uint64_t all_false_free() const;
  [[nodiscard]] std::uint64_t all_false_lethal() const;
  /// Share of the cells called free that are. A removed vehicle's place counts as free with
  /// `without_vehicles`: the city as it is once they have left.
  [[nodiscard]] std::optional<double> precision(bool without_vehicles) const;
  /// Share of the truly free cells that are called free.
  [[nodiscard]] std::optional<double> recall() const;
};

[[nodiscard]] TraversabilityScore score_traversability(const TraversabilityView& view,
                                                       const TraversabilityTruth& truth);

}  // namespace stillmap
