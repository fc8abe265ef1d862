#include "clients/commands/mapping/pose_files.hpp"

#include <array>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <stdexcept>
#include <string>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/file_stamp.hpp"
#include "core/dataset/kitti_files.hpp"

namespace stillmap::cli {
namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;
constexpr std::size_t tum_columns = 8;

std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

bool is_remark(const std::vector<std::string>& words) {
  return words.empty() || words.front().front() == '#';
}

bool is_tum(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) throw DatasetError(file, "cannot be opened; check the name and its permissions");
  for (std::string line; std::getline(stream, line);) {
    const std::vector<std::string> words = words_of(line);
    if (!is_remark(words)) return words.size() == tum_columns;
  }
  throw DatasetError(file, "holds no poses");
}

void add_tum_line(const std::vector<std::string>& words, PoseFile& result) {
  const std::optional<std::int64_t> stamp_ns = ns_from_seconds(words.at(0));
  if (words.size() != tum_columns || !stamp_ns) {
    throw std::invalid_argument("is not a stamp and seven numbers");
  }
  std::array<double, 7> v{};
  for (std::size_t i = 0; i < v.size(); ++i) v[i] = std::stod(words[i + 1]);
  const Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
  if (!(std::abs(rotation.norm() - 1.0) < 0.01)) {
    throw std::invalid_argument("has a quaternion that is not of length 1");
  }
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotation.normalized().toRotationMatrix();
  T.translation() = Eigen::Vector3d(v[0], v[1], v[2]);
  result.poses.push_back(T);
  result.stamps_ns.push_back(*stamp_ns);
}

PoseFile read_tum(const std::filesystem::path& file) {
  std::ifstream stream(file);
  PoseFile result;
  std::size_t line_number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++line_number;
    const std::vector<std::string> words = words_of(line);
    if (is_remark(words)) continue;
    try {
      add_tum_line(words, result);
    } catch (const std::exception& error) {
      throw DatasetError(file, "line " + std::to_string(line_number) + " " + error.what());
    }
  }
  return result;
}

Trajectory stamped(const PoseFile& file) {
  Trajectory trajectory;
  for (std::size_t i = 0; i < file.poses.size(); ++i) {
    trajectory.push_back({file.stamps_ns[i], file.poses[i]});
  }
  return trajectory;
}

}  // namespace

PoseFile read_pose_file(const std::filesystem::path& file) {
  if (is_tum(file)) return read_tum(file);
  return {.poses = read_poses(file), .stamps_ns = {}};
}

void write_tum(const std::filesystem::path& file, const Trajectory& trajectory,
               const std::string& frame) {
  std::ofstream out(file, std::ios::trunc);
  out << "# stamp[s] x y z[m] qx qy qz qw: takes points of the frame '" << frame
      << "' to the map, which begins at the first pose\n"
      << std::fixed << std::setprecision(9);
  for (const StampedPose& pose : trajectory) {
    const Eigen::Quaterniond q(pose.T_map_lidar.linear());
    const Eigen::Vector3d t = pose.T_map_lidar.translation();
    out << (pose.stamp_ns < 0 ? "-" : "") << std::abs(pose.stamp_ns / ns_per_s) << "."
        << std::setw(9) << std::setfill('0') << std::abs(pose.stamp_ns % ns_per_s) << " " << t.x()
        << " " << t.y() << " " << t.z() << " " << q.x() << " " << q.y() << " " << q.z() << " "
        << q.w() << "\n";
  }
  out.close();
  if (!out) throw DatasetWriteError(file, "cannot be written; check the folder and the space left");
}

void write_kitti_poses(const std::filesystem::path& file, const Trajectory& trajectory) {
  std::vector<Eigen::Isometry3d> poses;
  poses.reserve(trajectory.size());
  for (const StampedPose& pose : trajectory) poses.push_back(pose.T_map_lidar);
  write_poses(file, poses);
}

void write_poses_as_named(const std::filesystem::path& file, const Trajectory& trajectory,
                          const std::string& frame) {
  file.extension() == ".tum" ? write_tum(file, trajectory, frame)
                             : write_kitti_poses(file, trajectory);
}

evaluation::PosePairs pair_poses(const PoseFile& truth, const PoseFile& estimate,
                                 std::int64_t max_difference_ns) {
  if (truth.stamps_ns.empty() || estimate.stamps_ns.empty()) {
    return evaluation::pair_by_index(truth.poses, estimate.poses);
  }
  return evaluation::pair_by_stamp(stamped(truth), stamped(estimate), max_difference_ns);
}

}  // namespace stillmap::cli
