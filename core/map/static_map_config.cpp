#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>

#include "core/map/static_map.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

std::string tile_size_fault(const StaticMapConfig& config) {
  const double columns = config.tile_size_m / config.voxel_size_m;
  // 20.0 / 0.2 is not exactly 100.
  if (columns >= 1.0 - 1e-6 && columns <= VoxelGrid::max_columns + 1e-6 &&
      std::abs(columns - std::round(columns)) < 1e-6 * columns) {
    return {};
  }
  std::ostringstream fault;
  fault << "tile_size_m = " << config.tile_size_m << "; must be 1 to " << VoxelGrid::max_columns
        << " whole voxels of voxel_size_m (" << config.voxel_size_m << ")\n";
  return fault.str();
}

bool is_same_size(double a_m, double b_m) { return std::abs(a_m - b_m) <= 1e-9; }

}  // namespace

std::string StaticMapConfig::faults() const {
  constexpr double min_voxel_size_m = 0.01;
  constexpr double max_range_tiles = 100.0;
  std::ostringstream faults;
  if (!(voxel_size_m >= min_voxel_size_m && voxel_size_m <= 10.0)) {
    faults << "voxel_size_m = " << voxel_size_m << "; must be 0.01 to 10\n";
  }
  faults << tile_size_fault(*this);
  if (!(max_range_m > 0.0 && max_range_m <= max_range_tiles * tile_size_m)) {
    faults << "max_range_m = " << max_range_m << "; must be above 0 and at most " << max_range_tiles
           << " tiles (" << max_range_tiles * tile_size_m << ")\n";
  }
  if (!(clearing_range_m >= 0.0 && clearing_range_m <= 1000.0)) {
    faults << "clearing_range_m = " << clearing_range_m << "; must be 0 (off) to 1000\n";
  }
  if (!(clearing_margin_m > 0.0 && clearing_margin_m <= 100.0)) {
    faults << "clearing_margin_m = " << clearing_margin_m << "; must be above 0 and at most 100\n";
  }
  if (!(clearing_margin_share >= 0.0 && clearing_margin_share <= 1.0)) {
    faults << "clearing_margin_share = " << clearing_margin_share << "; must be 0 to 1\n";
  }
  if (clearing_interval == 0 || clearing_interval > 1000) {
    faults << "clearing_interval = " << clearing_interval << "; must be 1 to 1000\n";
  }
  if (misses_to_clear == 0 || misses_to_clear > 1000)
    faults << "misses_to_clear = " << misses_to_clear << "; must be 1 to 1000\n";
  if (!(misses_per_hit >= 0.0 && misses_per_hit <= 1000.0))
    faults << "misses_per_hit = " << misses_per_hit << "; must be 0 to 1000\n";
  if (label_trust == 0 || label_trust > 1000)
    faults << "label_trust = " << label_trust << "; must be 1 to 1000\n";
  if (free_space_history > 1000)
    faults << "free_space_history = " << free_space_history << "; must be at most 1000\n";
  if (min_points == 0) faults << "min_points = 0; must be at least 1\n";
  return faults.str();
}

void check_sizes(const MapSnapshot& stored, const StaticMapConfig& config) {
  if (stored.tiles.empty() || (is_same_size(stored.voxel_size_m, config.voxel_size_m) &&
                               is_same_size(stored.tile_size_m, config.tile_size_m))) {
    return;
  }
  std::ostringstream fault;
  fault << "the stored map has voxel_size_m " << stored.voxel_size_m << " and tile_size_m "
        << stored.tile_size_m << ", the configuration has " << config.voxel_size_m << " and "
        << config.tile_size_m << ": configure the stored sizes, or start a new map";
  throw std::invalid_argument(fault.str());
}

}  // namespace stillmap
