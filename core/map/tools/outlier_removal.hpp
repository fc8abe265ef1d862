#pragma once

#include <string>
#include <vector>

#include "core/map/query/map_query.hpp"

namespace stillmap {

/// Which voxels stand apart from the others.
struct OutlierRemovalConfig {
  /// So many of the nearest other voxels are looked at; 1 to 1000.
  int neighbours = 8;
  /// A voxel is an outlier when its mean distance to them exceeds the mean of all voxels by more
  /// standard deviations than this. Above 0.
  double sigma = 3.0;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// The voxels that are no outliers, in their order: the statistical outlier removal of Rusu et al.,
/// "Towards 3D point cloud based object maps for household environments" (2008), as in PCL. Throws
/// std::invalid_argument with `config.faults()`, or for voxels that have too few neighbours.
[[nodiscard]] std::vector<QueryVoxel> without_outliers(const std::vector<QueryVoxel>& voxels,
                                                       const OutlierRemovalConfig& config);

}  // namespace stillmap
