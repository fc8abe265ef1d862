#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>

#include "core/traversability/traversability_view.hpp"

namespace stillmap::evaluation {

/// True state of a cell for a view's robot.
struct CellTruth {
  /// `none` if the cell is traversable.
  BlockReason reason = BlockReason::none;
  /// Blocked only by a parked vehicle, which is not part of the static map.
  bool is_removed_vehicle = false;
  /// Beside a step of the ground, or between two ground classes.
  bool is_edge = false;
};

/// The truth at a point on the ground, map frame [m].
using TraversabilityTruth = std::function<CellTruth(const Eigen::Vector3d& ground_map)>;

/// Cause of a false free cell; the first that applies.
enum class FalseFree : std::uint8_t {
  /// A parked vehicle stood there, which the static map leaves out on purpose.
  removed_vehicle,
  /// The cell touches a step or class boundary and was assigned to its other side.
  edge,
  /// The ground was inferred.
  inferred,
  obstacle,
  step,
  ground_class,
};
inline constexpr std::size_t false_free_count = 6;

[[nodiscard]] std::string_view name(FalseFree cause);

/// Comparison of a view with the truth, cell by cell, without unknown cells. Inscribed cells count
/// as free.
struct TraversabilityScore {
  std::uint64_t free_and_truly_free = 0;
  std::uint64_t lethal_and_truly_lethal = 0;
  /// Indexed by the `BlockReason` of the cell.
  std::array<std::uint64_t, block_reason_count> false_lethal{};
  std::array<std::uint64_t, false_free_count> false_free{};

  [[nodiscard]] std::uint64_t all_false_free() const;
  [[nodiscard]] std::uint64_t all_false_lethal() const;
  /// Share of the free cells that are truly free. With `without_vehicles`, the footprints of
  /// removed vehicles count as truly free.
  [[nodiscard]] std::optional<double> precision(bool without_vehicles) const;
  /// Share of the truly free cells that are free.
  [[nodiscard]] std::optional<double> recall() const;
};

[[nodiscard]] TraversabilityScore score_traversability(const TraversabilityView& view,
                                                       const TraversabilityTruth& truth);

}  // namespace stillmap::evaluation
