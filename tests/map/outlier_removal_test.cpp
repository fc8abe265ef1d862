#include "core/map/tools/outlier_removal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::HasSubstr;

QueryVoxel voxel_at(float x, float y, float z, SemanticClass label) {
  return {.position_map = {x, y, z}, .label = label, .confidence = 1.0F, .point_count = 1};
}

/// A wall of 20 by 20 voxels of 0.2 m, whose points are anywhere in them.
std::vector<QueryVoxel> wall() {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> offset(-0.1F, 0.1F);
  std::vector<QueryVoxel> voxels;
  for (int i = 0; i < 400; ++i) {
    voxels.push_back(voxel_at(0.2F * static_cast<float>(i % 20) + offset(random), offset(random),
                              0.2F * static_cast<float>(i / 20) + offset(random),
                              SemanticClass::building));
  }
  return voxels;
}

std::vector<Eigen::Vector3f> positions(const std::vector<QueryVoxel>& voxels) {
  std::vector<Eigen::Vector3f> positions;
  for (const QueryVoxel& voxel : voxels) positions.push_back(voxel.position_map);
  return positions;
}

/// As without_outliers(), from the distances between all voxels.
std::vector<QueryVoxel> slowly_without_outliers(const std::vector<QueryVoxel>& voxels,
                                                const OutlierRemovalConfig& config) {
  std::vector<double> mean_distances;
  for (const QueryVoxel& voxel : voxels) {
    std::vector<double> distances;
    for (const QueryVoxel& other : voxels) {
      distances.push_back((voxel.position_map - other.position_map).cast<double>().norm());
    }
    std::ranges::sort(distances);
    const auto nearest = distances.begin() + 1;  // after the voxel itself
    mean_distances.push_back(std::accumulate(nearest, nearest + config.neighbours, 0.0) /
                             config.neighbours);
  }
  const auto count = static_cast<double>(voxels.size());
  const double mean = std::accumulate(mean_distances.begin(), mean_distances.end(), 0.0) / count;
  double squares = 0.0;
  for (const double distance : mean_distances) squares += (distance - mean) * (distance - mean);
  const double limit = mean + config.sigma * std::sqrt(squares / (count - 1.0));
  std::vector<QueryVoxel> rest;
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    if (mean_distances[i] <= limit) rest.push_back(voxels[i]);
  }
  return rest;
}

TEST(OutlierRemoval, TakesPlantedOutliersAndNothingElse) {
  std::vector<QueryVoxel> voxels = wall();
  for (const int at : {400, 250, 0}) {
    const auto height = static_cast<float>(at) / 100.0F;
    voxels.insert(voxels.begin() + at, voxel_at(2.0F, -6.0F, height, SemanticClass::pole));
  }
  const std::vector<QueryVoxel> rest = without_outliers(voxels, {.neighbours = 8, .sigma = 3.0});
  EXPECT_EQ(positions(rest), positions(wall()));
  EXPECT_TRUE(std::ranges::all_of(
      rest, [](const QueryVoxel& voxel) { return voxel.label == SemanticClass::building; }));
}

// Distances differ by rounding alone.
TEST(OutlierRemoval, LeavesARegularGridAsItIs) {
  for (const float x_m : {0.0F, 50.0F}) {
    std::vector<QueryVoxel> voxels;
    for (int i = 0; i < 900; ++i) {
      voxels.push_back(voxel_at(x_m + 0.1F * static_cast<float>(i % 30),
                                0.1F * static_cast<float>(i / 30), 0.0F, SemanticClass::road));
    }
    for (const int neighbours : {1, 2}) {
      EXPECT_EQ(without_outliers(voxels, {.neighbours = neighbours, .sigma = 3.0}).size(), 900U)
          << x_m << " m, " << neighbours;
    }
  }
}

TEST(OutlierRemoval, AgreesWithASearchThroughAllVoxels) {
  std::mt19937 random(11);
  std::normal_distribution<float> coordinate(0.0F, 5.0F);
  std::vector<QueryVoxel> voxels;
  for (int i = 0; i < 600; ++i) {
    voxels.push_back(voxel_at(coordinate(random), coordinate(random), coordinate(random),
                              SemanticClass::vegetation));
  }
  for (const OutlierRemovalConfig& config :
       {OutlierRemovalConfig{.neighbours = 1, .sigma = 1.0},
        OutlierRemovalConfig{.neighbours = 8, .sigma = 0.5},
        OutlierRemovalConfig{.neighbours = 599, .sigma = 2.0}}) {
    const std::vector<QueryVoxel> rest = without_outliers(voxels, config);
    EXPECT_EQ(positions(rest), positions(slowly_without_outliers(voxels, config)));
    EXPECT_LT(rest.size(), voxels.size());
  }
}

TEST(OutlierRemoval, KeepsVoxelsThatAllStandAlike) {
  std::vector<QueryVoxel> circle;
  for (int i = 0; i < 100; ++i) {
    const float angle = 0.02F * std::numbers::pi_v<float> * static_cast<float>(i);
    circle.push_back(voxel_at(std::cos(angle), std::sin(angle), 0.0F, SemanticClass::traffic_sign));
  }
  EXPECT_EQ(without_outliers(circle, {.neighbours = 2, .sigma = 3.0}).size(), circle.size());
  const std::vector<QueryVoxel> same(20, circle.front());
  EXPECT_EQ(without_outliers(same, {.neighbours = 8, .sigma = 1.0}).size(), same.size());
}

TEST(OutlierRemoval, RefusesWhatCannotWork) {
  const auto refusal = [](const std::vector<QueryVoxel>& voxels, OutlierRemovalConfig config) {
    return message_of<std::invalid_argument>(
        [&] { static_cast<void>(without_outliers(voxels, config)); });
  };
  EXPECT_THAT(refusal(wall(), {.neighbours = 0}), HasSubstr("neighbours = 0"));
  EXPECT_THAT(refusal(wall(), {.neighbours = 1001}), HasSubstr("1 to 1000"));
  EXPECT_THAT(refusal(wall(), {.sigma = 0.0}), HasSubstr("sigma = 0"));
  EXPECT_THAT(refusal(wall(), {.sigma = std::nan("")}), HasSubstr("sigma = nan"));
  EXPECT_THAT(refusal(wall(), {.sigma = std::numeric_limits<double>::infinity()}),
              HasSubstr("sigma = inf"));
  EXPECT_THAT(refusal(wall(), {.neighbours = 400}), HasSubstr("400 voxels with 400 neighbours"));
  EXPECT_THAT(refusal({}, {}), HasSubstr("0 voxels"));
}

}  // namespace
}  // namespace stillmap
