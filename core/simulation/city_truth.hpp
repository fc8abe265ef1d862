#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>

#include "core/lidar/semantic_class.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap::simulation {

/// What stands on a spot of the city.
enum class Standing : std::uint8_t {
  nothing,
  /// Movable objects only.
  parked,
  /// Immovable: a house, a fence, a tree.
  fixed,
};

/// Ground truth of a square of ground.
struct TrueGround {
  /// Height of the bare ground in the middle [m, city frame].
  double height_m = 0.0;
  /// Class of the bare ground in the middle.
  SemanticClass label = SemanticClass::unlabeled;
  /// Largest height difference between the middle and the ground up to `edge_m` away in x or y [m].
  double step_m = 0.0;
  /// Some of that ground is of another class than the middle.
  bool is_edge = false;
  Standing standing = Standing::nothing;
};

/// Ground truth of a simulated city, to evaluate maps of its sequences against. Without traffic.
class CityTruth {
 public:
  explicit CityTruth(const SimulationConfig& config);
  ~CityTruth();

  /// The square of `edge_m` around `spot_city`, and what stands in it from `from_m` to `to_m` above
  /// the ground [m]. Thread-safe.
  [[nodiscard]] TrueGround at(const Eigen::Vector2d& spot_city, double edge_m, double from_m,
                              double to_m) const;

 private:
  struct World;
  std::unique_ptr<World> world_;
};

}  // namespace stillmap::simulation
