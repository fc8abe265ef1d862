// Real sweeps of an Ouster, raw and deskewed by their IMU: newer_06/newer_06 in the folder that
// STILLMAP_TEST_DATA names, with raw_NN.bin (x y z in the lidar's frame), deskewed_NN.bin (in that
// of the IMU at the sweep's start) and times_NN.bin (seconds since then), all float32.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "core/lidar/prepare.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

constexpr double sweep_s = 0.1;

std::vector<float> read_floats(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  std::vector<float> values(bytes.size() / sizeof(float));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(float));
  return values;
}

/// Some points of a sweep, raw and deskewed, in the IMU's frame.
struct Sweep {
  Scan raw;
  std::vector<Eigen::Vector3f> deskewed_imu;

  Sweep(const std::filesystem::path& folder, const std::string& number) {
    constexpr std::size_t every = 23;
    // As the makers of this lidar give it: half a turn about z.
    const Eigen::Vector3f lidar_imu(-0.006253F, 0.011775F, -0.028535F);
    const auto points = read_floats(folder / ("raw_" + number + ".bin"));
    const auto deskewed = read_floats(folder / ("deskewed_" + number + ".bin"));
    const auto times_s = read_floats(folder / ("times_" + number + ".bin"));
    EXPECT_EQ(points.size(), 3 * times_s.size());
    EXPECT_EQ(deskewed.size(), points.size());
    for (std::size_t i = 0; i < times_s.size(); i += every) {
      raw.points_lidar.push_back(
          Eigen::Vector3f(-points[3 * i], -points[3 * i + 1], points[3 * i + 2]) + lidar_imu);
      raw.time_offset_s.push_back(times_s[i]);
      deskewed_imu.emplace_back(deskewed[3 * i], deskewed[3 * i + 1], deskewed[3 * i + 2]);
    }
  }

  /// What deskew() leaves for this motion during the sweep, a point in three rows [m].
  [[nodiscard]] Eigen::VectorXd residuals_m(const PoseTangent& twist) const {
    const Scan found = deskew(raw, motion_of(twist), sweep_s);
    Eigen::VectorXd off(3 * raw.size());
    for (std::size_t i = 0; i < raw.size(); ++i) {
      off.segment<3>(static_cast<Eigen::Index>(3 * i)) =
          (found.points_lidar[i] - deskewed_imu[i]).cast<double>();
    }
    return off;
  }
  [[nodiscard]] double median_m(const PoseTangent& twist) const {
    const Eigen::VectorXd off = residuals_m(twist);
    std::vector<double> distances;
    for (Eigen::Index i = 0; i < off.size(); i += 3) distances.push_back(off.segment<3>(i).norm());
    std::ranges::nth_element(distances, distances.begin() + std::ssize(distances) / 2);
    return distances[distances.size() / 2];
  }
};

/// The steady motion during the sweep that explains the deskewed points best (Gauss-Newton).
PoseTangent best_motion(const Sweep& sweep) {
  constexpr double step = 1e-4;
  PoseTangent twist = PoseTangent::Zero();
  for (int round = 0; round < 6; ++round) {
    const Eigen::VectorXd off = sweep.residuals_m(twist);
    Eigen::MatrixXd slopes(off.size(), 6);
    for (int axis = 0; axis < 6; ++axis) {
      const PoseTangent aside = twist + step * PoseTangent::Unit(axis);
      slopes.col(axis) = (sweep.residuals_m(aside) - off) / step;
    }
    twist -= (slopes.transpose() * slopes).ldlt().solve(slopes.transpose() * off);
  }
  return twist;
}

TEST(RecordedDeskew, SteadyMotionExplainsWhatTheImuMadeOfRawSweeps) {
  const char* recordings = std::getenv("STILLMAP_TEST_DATA");
  if (recordings == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA names no folder of recordings";
  const auto folder = std::filesystem::path(recordings) / "newer_06" / "newer_06";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  for (const std::string number : {"00", "01", "02"}) {
    SCOPED_TRACE(number);
    const Sweep sweep(folder, number);
    ASSERT_GT(sweep.raw.size(), 500U);
    const PoseTangent motion = best_motion(sweep);
    // A lidar in a hand: it turns by up to ten degrees a sweep, not quite steadily.
    EXPECT_GT(motion.tail<3>().norm(), 0.05);
    EXPECT_LT(motion.head<3>().norm(), 0.2);
    EXPECT_LT(sweep.median_m(motion), 0.06);
    EXPECT_LT(sweep.median_m(motion), 0.1 * sweep.median_m(PoseTangent::Zero()));
  }
}

}  // namespace
}  // namespace stillmap
