#include "core/map/tools/outlier_removal.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <cstddef>
#include <nanoflann.hpp>
#include <numeric>
#include <sstream>
#include <stdexcept>

namespace stillmap {
namespace {

/// Voxels as nanoflann sees points.
struct VoxelCloud {
  const std::vector<QueryVoxel>& voxels;

  [[nodiscard]] std::size_t kdtree_get_point_count() const { return voxels.size(); }
  [[nodiscard]] float kdtree_get_pt(std::size_t voxel, std::size_t axis) const {
    return voxels[voxel].position_map[static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box& /*box*/) const {
    return false;
  }
};

using VoxelTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, VoxelCloud>, VoxelCloud,
                                        3, std::size_t>;

/// Of each voxel, to its nearest others [m].
std::vector<double> mean_distances(const std::vector<QueryVoxel>& voxels, int neighbours) {
  const VoxelCloud cloud{voxels};
  const VoxelTree tree(3, cloud);
  // Nearest of all is the voxel itself, or one at its very place.
  const auto wanted = static_cast<std::size_t>(neighbours) + 1;
  std::vector<double> means(voxels.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, voxels.size(), 1024), [&](const auto& some) {
    std::vector<std::size_t> nearest(wanted);
    std::vector<float> squared(wanted);
    for (std::size_t i = some.begin(); i < some.end(); ++i) {
      tree.knnSearch(voxels[i].position_map.data(), wanted, nearest.data(), squared.data());
      double sum = 0.0;
      for (std::size_t k = 1; k < wanted; ++k) sum += std::sqrt(static_cast<double>(squared[k]));
      means[i] = sum / neighbours;
    }
  });
  return means;
}

/// Mean plus `sigma` standard deviations, and what rounding makes of equal distances.
double upper_limit(const std::vector<double>& values, double sigma) {
  const auto count = static_cast<double>(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
  double squares = 0.0;
  for (const double value : values) squares += (value - mean) * (value - mean);
  constexpr double rounding = 1e-4;
  return (1.0 + rounding) * mean + sigma * std::sqrt(squares / (count - 1.0));
}

}  // namespace

std::string OutlierRemovalConfig::faults() const {
  std::ostringstream faults;
  if (neighbours < 1 || neighbours > 1000) {
    faults << "neighbours = " << neighbours << "; must be 1 to 1000\n";
  }
  if (!(sigma > 0.0 && std::isfinite(sigma)))
    faults << "sigma = " << sigma << "; must be above 0\n";
  return faults.str();
}

std::vector<QueryVoxel> without_outliers(const std::vector<QueryVoxel>& voxels,
                                         const OutlierRemovalConfig& config) {
  if (const std::string faults = config.faults(); !faults.empty()) {
    throw std::invalid_argument(faults);
  }
  if (voxels.size() <= static_cast<std::size_t>(config.neighbours)) {
    throw std::invalid_argument("outliers cannot be told among " + std::to_string(voxels.size()) +
                                " voxels with " + std::to_string(config.neighbours) +
                                " neighbours each; take fewer neighbours, or more of the map");
  }
  const std::vector<double> distances = mean_distances(voxels, config.neighbours);
  const double limit = upper_limit(distances, config.sigma);
  std::vector<QueryVoxel> rest;
  rest.reserve(voxels.size());
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    if (distances[i] <= limit) rest.push_back(voxels[i]);
  }
  return rest;
}

}  // namespace stillmap
