// kiss_icp_runner SEQUENCE OUT [SCANS]: KISS-ICP with its default configuration on a SemanticKITTI
// folder, at most SCANS of its scans. Writes into OUT poses_lidar.txt (3x4, a line a scan, at the
// stamps), ms.txt and processor_ms.txt (milliseconds without reading, a line a scan). Built by
// kiss_icp_bench.py, not by CMake: KISS-ICP is not a part of this repository.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <kiss_icp/pipeline/KissICP.hpp>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

std::vector<float> read_floats(std::istream& in) {
  const std::string bytes((std::istreambuf_iterator<char>(in)), {});
  std::vector<float> values(bytes.size() / sizeof(float));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(float));
  return values;
}

/// Reads the header of a .pcd up to its points, which must be four floats each.
void skip_pcd_header(std::istream& in, const fs::path& file) {
  std::string line;
  while (std::getline(in, line) && !line.starts_with("DATA")) {
    if (line.starts_with("SIZE") && line != "SIZE 4 4 4 4")
      throw std::runtime_error(file.string() + ": its points are not four floats each");
  }
  if (line != "DATA binary")
    throw std::runtime_error(file.string() + ": its points are not binary");
}

struct SweepPoints {
  std::vector<Eigen::Vector3d> points_lidar;
  /// Relative to the stamp [s]; empty where unknown.
  std::vector<double> times_s;
};

SweepPoints read_scan(const fs::path& file, const fs::path& times_file) {
  constexpr double min_range_m = 0.5;
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  if (file.extension() == ".pcd") skip_pcd_header(in, file);
  const std::vector<float> values = read_floats(in);
  std::ifstream times_in(times_file, std::ios::binary);
  const std::vector<float> times = times_in ? read_floats(times_in) : std::vector<float>();
  SweepPoints scan;
  for (std::size_t i = 0; i < values.size() / 4; ++i) {
    const Eigen::Vector3d p(values[4 * i], values[4 * i + 1], values[4 * i + 2]);
    if (!p.allFinite() || p.norm() <= min_range_m) continue;
    scan.points_lidar.push_back(p);
    if (i < times.size()) scan.times_s.push_back(times[i]);
  }
  return scan;
}

std::vector<fs::path> scan_files(const fs::path& sequence, std::size_t max_count) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(sequence / "velodyne"))
    if (entry.path().extension() == ".bin" || entry.path().extension() == ".pcd")
      files.push_back(entry.path());
  std::ranges::sort(files);
  files.resize(std::min(files.size(), max_count));
  return files;
}

/// KISS-ICP's poses are at the sweep's end: part of the sweep from there back to the stamp.
double part_after_stamp(const std::vector<double>& times_s) {
  if (times_s.empty()) return 0.0;
  const auto [first, last] = std::ranges::minmax_element(times_s);
  return *last > *first ? *last / (*last - *first) : 0.0;
}

Sophus::SE3d moved_back(const Sophus::SE3d& pose, const Sophus::SE3d& sweep, double part) {
  return pose * Sophus::SE3d::exp(-part * sweep.log());
}

void write_pose(std::ostream& out, const Sophus::SE3d& pose) {
  const auto matrix = pose.matrix3x4();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      out << matrix(row, column) << (row == 2 && column == 3 ? "\n" : " ");
}

double process_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void run(const fs::path& sequence, const fs::path& out, std::size_t max_count) {
  using Clock = std::chrono::steady_clock;
  kiss_icp::pipeline::KissICP odometry{kiss_icp::pipeline::KISSConfig{}};
  std::ofstream ms(out / "ms.txt"), processor_ms(out / "processor_ms.txt");
  std::vector<Sophus::SE3d> poses;
  double first_part = 0.0;
  for (const fs::path& file : scan_files(sequence, max_count)) {
    const SweepPoints scan =
        read_scan(file, sequence / "time_offsets" / file.filename().replace_extension(".bin"));
    const double began_ms = process_ms();
    const Clock::time_point began = Clock::now();
    odometry.RegisterFrame(scan.points_lidar, scan.times_s);
    ms << std::chrono::duration<double, std::milli>(Clock::now() - began).count() << "\n";
    processor_ms << process_ms() - began_ms << "\n";
    const double part = part_after_stamp(scan.times_s);
    if (poses.empty()) first_part = part;
    // The first sweep's motion is that of the second, as far as it knows.
    if (poses.size() == 1) poses[0] = moved_back(poses[0], odometry.delta(), first_part);
    poses.push_back(moved_back(odometry.pose(), odometry.delta(), part));
  }
  std::ofstream poses_file(out / "poses_lidar.txt");
  poses_file.precision(9);
  for (const Sophus::SE3d& pose : poses) write_pose(poses_file, pose);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc != 3 && argc != 4)
      throw std::invalid_argument("usage: kiss_icp_runner SEQUENCE OUT [SCANS]");
    run(argv[1], argv[2],
        argc == 4 ? std::stoul(argv[3]) : std::numeric_limits<std::size_t>::max());
  } catch (const std::exception& error) {
    std::cerr << "kiss_icp_runner: " << error.what() << "\n";
    return 1;
  }
}
