#include "core/map/tools/outlier_removal.hpp"

#include <pcl/filters/statistical_outlier_removal.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include <cmath>
#include <memory>
#include <sstream>
#include <stdexcept>

namespace stillmap {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

std::shared_ptr<const Cloud> cloud_of(const std::vector<QueryVoxel>& voxels) {
  auto cloud = std::make_shared<Cloud>();
  cloud->reserve(voxels.size());
  for (const QueryVoxel& voxel : voxels) {
    const Eigen::Vector3f& position = voxel.position_map;
    cloud->emplace_back(position.x(), position.y(), position.z());
  }
  return cloud;
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
  // PCL would read past the end of what it finds.
  if (voxels.size() <= static_cast<std::size_t>(config.neighbours)) {
    throw std::invalid_argument("outliers cannot be told among " + std::to_string(voxels.size()) +
                                " voxels with " + std::to_string(config.neighbours) +
                                " neighbours each; take fewer neighbours, or more of the map");
  }
  pcl::StatisticalOutlierRemoval<pcl::PointXYZ> filter;
  filter.setInputCloud(cloud_of(voxels));
  filter.setMeanK(config.neighbours);
  filter.setStddevMulThresh(config.sigma);
  pcl::Indices kept;
  filter.filter(kept);
  std::vector<QueryVoxel> rest;
  rest.reserve(kept.size());
  for (const auto i : kept) rest.push_back(voxels[static_cast<std::size_t>(i)]);
  return rest;
}

}  // namespace stillmap
