#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "core/lidar/semantic_class.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap::simulation {

/// What stands over a spot of the city.
enum class Standing : std::uint8_t {
  nothing,
  /// A parked vehicle, and nothing that stays.
  parked,
  /// A house, a fence, a tree: what is still there tomorrow.
  fixed,
};

/// The truth about a square of ground.
struct TrueGround {
  /// Height of the bare ground in the middle, city frame [m].
  double height_m = 0.0;
  /// Of the bare ground.
  SemanticClass label = SemanticClass::unlabeled;
  /// Highest edge between the square's middle and the ground half a square beyond its sides [m].
  double step_m = 0.0;
  /// The ground there is of another class than in the middle, somewhere.
  bool is_edge = false;
  Standing standing = Standing::nothing;
};

/// The simulated city as it is, whoever saw it: the truth that maps made from its recordings are
/// held against. Traffic is not part of it.
class CityTruth {
 public:
  explicit CityTruth(const SimulationConfig& config);
  ~CityTruth();

  /// The square of this edge [m] around a spot (city frame [m]), and what stands in it between two
  /// heights over the ground [m]. Thread-safe.
  [[nodiscard]] TrueGround at(const Eigen::Vector2d& spot_city, double edge_m, double from_m,
                              double to_m) const;

 private:
  struct World;
  std::unique_ptr<World> world_;
};

}  // namespace stillmap::simulation
