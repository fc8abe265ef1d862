#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "core/evaluation/relative_pose_error.hpp"
#include "tests/evaluation/simple_paths.hpp"

namespace stillmap::evaluation {
namespace {

test::Path read_poses(const std::filesystem::path& file) {
  std::ifstream stream(file);
  test::Path path;
  Eigen::Matrix<double, 3, 4> rows;
  while (true) {
    for (int i = 0; i < 12; ++i) stream >> rows(i / 4, i % 4);
    if (!stream) return path;
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.matrix().topRows<3>() = rows;
    path.push_back(T);
  }
}

// The figures were made with the benchmark's own development kit.
TEST(KittiOdometryError, AgreesWithTheDevelopmentKitOnARealEstimate) {
  const char* data = std::getenv("STILLMAP_TEST_DATA");
  if (data == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA does not name the folder of recordings";
  const std::filesystem::path folder = std::filesystem::path(data) / "kitti_metric";
  const PosePairs pairs = pair_by_index(read_poses(folder / "05_ground_truth.txt"),
                                        read_poses(folder / "05_estimate.txt"));
  const KittiOdometryError error = kitti_odometry_error(pairs).value();
  EXPECT_NEAR(error.translation_percent, 0.426, 0.0005);
  EXPECT_NEAR(error.rotation_deg_per_100m, 0.159, 0.0005);
}

}  // namespace
}  // namespace stillmap::evaluation
