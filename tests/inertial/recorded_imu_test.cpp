// A real IMU against the trajectory of its recording: newer_06/continuous in the folder that
// STILLMAP_TEST_DATA names, with imu.txt and traj.txt (stamp, position, quaternion x y z w of the
// IMU).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "core/dataset/imu_file.hpp"
#include "core/inertial/imu_track.hpp"

namespace stillmap {
namespace {

struct StampedAttitude {
  std::int64_t stamp_ns;
  Eigen::Quaterniond R_map_imu;
};

std::vector<StampedAttitude> read_attitudes(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<StampedAttitude> attitudes;
  double t, px, py, pz, x, y, z, w;
  while (in >> t >> px >> py >> pz >> x >> y >> z >> w)
    attitudes.push_back({std::llround(t * 1e9), Eigen::Quaterniond(w, x, y, z).normalized()});
  return attitudes;
}

TEST(RecordedImu, RatesMakeTheRotationsOfTheTrajectory) {
  const char* recordings = std::getenv("STILLMAP_TEST_DATA");
  if (recordings == nullptr) GTEST_SKIP() << "STILLMAP_TEST_DATA names no folder of recordings";
  const auto folder = std::filesystem::path(recordings) / "newer_06" / "continuous";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  const std::vector<ImuSample> samples = read_imu_file(folder / "imu.txt");
  const auto attitudes = read_attitudes(folder / "traj.txt");
  std::vector<double> errors_rad;
  ImuTrack track;
  std::size_t next = 0;
  for (std::size_t k = 1; k < attitudes.size(); ++k) {
    const auto& [to_ns, R_map_to] = attitudes[k];
    while (next < samples.size() && samples[next].stamp_ns <= to_ns + 20'000'000)
      ASSERT_EQ(track.add(samples[next++]), ImuSampleFate::taken);
    const auto& [from_ns, R_map_from] = attitudes[k - 1];
    const auto R = track.rotation(from_ns, to_ns, Eigen::Vector3d::Zero());
    if (R) errors_rad.push_back(R->angularDistance(R_map_from.conjugate() * R_map_to));
  }
  ASSERT_GT(errors_rad.size(), attitudes.size() * 9 / 10);
  std::ranges::sort(errors_rad);
  const double deg = 180.0 / M_PI;
  EXPECT_LT(deg * errors_rad[errors_rad.size() / 2], 0.01);
  EXPECT_LT(deg * errors_rad[errors_rad.size() * 95 / 100], 0.02);
}

}  // namespace
}  // namespace stillmap
