#pragma once

#include <cstdint>

namespace stillmap {

/// The paper's three kinds of points (II-C.2).
enum class Motion : std::uint8_t {
  /// Buildings, ground, poles: in the local map and in the static map.
  stationary = 0,
  /// Could move and stands still, as a parked car: in the local map, not in the static map.
  semi_static = 1,
  /// Moving now: in neither map.
  highly_dynamic = 2,
};

}  // namespace stillmap
