#pragma once

#include <cstdint>

namespace stillmap::dds {

/// Which state of which map an answer shows. Versions compare only within one map_id.
struct MapIdentity {
  std::uint64_t version = 0;
  std::uint64_t map_id = 0;
  double tile_size_m = 0.0;
  double voxel_size_m = 0.0;
};

}  // namespace stillmap::dds
