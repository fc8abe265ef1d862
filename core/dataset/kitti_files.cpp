#include "core/dataset/kitti_files.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/file_stamp.hpp"
#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

constexpr std::size_t pose_numbers = 12;
/// How far R R' may be from the identity: KITTI prints seven digits.
constexpr double rotation_tolerance = 1e-2;

constexpr std::string_view blanks = " \t\r";

/// The numbers of a line, or nothing when it holds anything else.
std::optional<std::vector<double>> numbers_in(std::string_view line) {
  std::vector<double> numbers;
  for (;;) {
    const std::size_t start = line.find_first_not_of(blanks);
    if (start == std::string_view::npos) return numbers;
    line.remove_prefix(line[start] == '+' ? start + 1 : start);
    double value = 0.0;
    const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), value);
    if (error != std::errc{} || !std::isfinite(value)) return std::nullopt;
    numbers.push_back(value);
    line.remove_prefix(static_cast<std::size_t>(end - line.data()));
    if (!line.empty() && blanks.find(line.front()) == std::string_view::npos) return std::nullopt;
  }
}

std::vector<std::string> lines_of(const std::filesystem::path& file) {
  static_cast<void>(scan_file_size(file));
  std::ifstream in(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  if (in.bad() || (lines.empty() && !in.eof())) {
    throw DatasetError(file, "cannot be read; check its permissions");
  }
  while (!lines.empty() && lines.back().find_first_not_of(blanks) == std::string::npos) {
    lines.pop_back();
  }
  return lines;
}

std::string_view without_blanks(std::string_view text) {
  const std::size_t begin = std::min(text.find_first_not_of(blanks), text.size());
  const std::size_t end = text.find_last_not_of(blanks);
  return end == std::string_view::npos ? "" : text.substr(begin, end + 1 - begin);
}

std::string at_line(std::size_t index) { return "line " + std::to_string(index + 1); }

Eigen::Isometry3d pose_from(const std::filesystem::path& file, const std::string& where,
                            const std::optional<std::vector<double>>& numbers) {
  if (!numbers || numbers->size() != pose_numbers) {
    throw DatasetError(file, where +
                                 " is not twelve numbers (a 3x4 pose, row by row); is this a "
                                 "KITTI pose file?");
  }
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(numbers->data());
  const Eigen::Matrix3d R = matrix.leftCols<3>();
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < rotation_tolerance &&
        R.determinant() > 0.0)) {
    throw DatasetError(file, where + " holds no rotation; the file is damaged or not a pose file");
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
  pose.translation() = matrix.col(3);
  return pose;
}

std::ofstream text_file(const std::filesystem::path& file) {
  std::ofstream out(file, std::ios::trunc);
  out << std::setprecision(12) << std::scientific;
  return out;
}

void finish(std::ofstream& out, const std::filesystem::path& file) {
  out.close();
  if (!out) throw DatasetWriteError(file, "cannot be written; check the folder and the space left");
}

void print_pose(std::ostream& out, const Eigen::Isometry3d& pose) {
  const Eigen::Matrix4d matrix = pose.matrix();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      out << (row + column == 0 ? "" : " ") << matrix(row, column);
    }
  }
  out << '\n';
}

}  // namespace

Scan read_kitti_bin(const std::filesystem::path& file) {
  const auto values = read_values<float>(file, 4);
  Scan scan;
  scan.points_lidar.reserve(values.size() / 4);
  scan.intensity.reserve(values.size() / 4);
  for (std::size_t i = 0; i < values.size(); i += 4) {
    scan.points_lidar.emplace_back(values[i], values[i + 1], values[i + 2]);
    scan.intensity.push_back(values[i + 3]);
  }
  return scan;
}

void write_kitti_bin(const std::filesystem::path& file, const Scan& scan) {
  std::vector<float> values;
  values.reserve(4 * scan.size());
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const auto& p = scan.points_lidar[i];
    values.insert(values.end(),
                  {p.x(), p.y(), p.z(), scan.intensity.empty() ? 0.0F : scan.intensity[i]});
  }
  write_values<float>(file, values);
}

std::vector<std::uint32_t> read_kitti_labels(const std::filesystem::path& file,
                                             std::size_t points) {
  auto labels = read_values<std::uint32_t>(file);
  if (labels.size() != points) {
    throw DatasetError(file, std::to_string(labels.size()) + " labels for a scan of " +
                                 std::to_string(points) +
                                 " points; take the labels that belong to this sequence");
  }
  return labels;
}

void write_kitti_labels(const std::filesystem::path& file, std::span<const std::uint32_t> labels) {
  write_values(file, labels);
}

std::vector<SemanticClass> reduced_classes(std::span<const std::uint32_t> raw_labels) {
  std::vector<SemanticClass> classes;
  classes.reserve(raw_labels.size());
  for (const std::uint32_t raw : raw_labels) {
    classes.push_back(class_from_semantic_kitti(static_cast<std::uint16_t>(raw & 0xFFFFU)));
  }
  return classes;
}

Eigen::Isometry3d read_kitti_calibration(const std::filesystem::path& file) {
  for (const std::string& line : lines_of(file)) {
    constexpr std::string_view key = "Tr:";
    if (!line.starts_with(key)) continue;
    return pose_from(file, "\"Tr:\"", numbers_in(std::string_view(line).substr(key.size())));
  }
  throw CameraUnknownError(file,
                           "has no entry \"Tr:\" (lidar to camera); take calib.txt of the "
                           "SemanticKITTI sequence");
}

void write_kitti_calibration(const std::filesystem::path& file,
                             const Eigen::Isometry3d& T_camera_lidar) {
  std::ofstream out = text_file(file);
  out << "Tr: ";
  print_pose(out, T_camera_lidar);
  finish(out, file);
}

namespace {

struct Unit {
  TimesUnit unit;
  std::int64_t to_a_second;
};
constexpr std::array<Unit, 3> smaller_units{{{TimesUnit::milliseconds, 1'000},
                                             {TimesUnit::microseconds, 1'000'000},
                                             {TimesUnit::nanoseconds, 1'000'000'000}}};
constexpr std::int64_t ns_of_a_second = 1'000'000'000;

/// Whether times as these, from scan to scan, are those of a lidar.
bool is_period(double seconds) { return seconds >= 0.02 && seconds <= 2.0; }

/// Median step from line to line; 0 of fewer than two.
double median_step(std::span<const std::int64_t> times) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.size(); ++i)
    steps.push_back(static_cast<double>(times[i]) - static_cast<double>(times[i - 1]));
  return steps.empty() ? 0.0 : median_of(steps);
}

/// Whole numbers that are too large for seconds; nothing where one is none.
std::optional<std::vector<std::int64_t>> whole_numbers(std::span<const std::string> lines) {
  std::vector<std::int64_t> numbers;
  for (const std::string& line : lines) {
    const std::string_view text = without_blanks(line);
    std::int64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
    numbers.push_back(number);
  }
  return numbers;
}

std::optional<KittiTimes> large_times(std::span<const std::string> lines) {
  std::optional<std::vector<std::int64_t>> numbers = whole_numbers(lines);
  if (!numbers) return std::nullopt;
  const double step = median_step(*numbers);
  for (const auto [unit, to_a_second] : smaller_units) {
    if (!is_period(step / static_cast<double>(to_a_second))) continue;
    const std::int64_t ns = ns_of_a_second / to_a_second;
    const std::int64_t largest = std::numeric_limits<std::int64_t>::max() / ns;
    if (std::ranges::any_of(*numbers, [&](auto n) { return n > largest || n < -largest; }))
      return std::nullopt;
    for (std::int64_t& number : *numbers) number *= ns;
    return KittiTimes{*std::move(numbers), unit};
  }
  return std::nullopt;
}

/// Of times that were taken for seconds.
KittiTimes understood(std::vector<std::int64_t> times_ns) {
  constexpr double longest_period_s = 40.0;
  const double step_s = 1e-9 * median_step(times_ns);
  // All alike, or in the other order: a single line tells nothing.
  if (times_ns.size() > 1 && step_s <= 0.0) return {std::move(times_ns), TimesUnit::none};
  if (step_s < longest_period_s) return {std::move(times_ns), TimesUnit::seconds};
  for (const auto [unit, to_a_second] : smaller_units) {
    if (!is_period(step_s / static_cast<double>(to_a_second))) continue;
    for (std::int64_t& time_ns : times_ns) time_ns /= to_a_second;
    return {std::move(times_ns), unit};
  }
  return {std::move(times_ns), TimesUnit::seconds};
}

}  // namespace

KittiTimes read_kitti_times(const std::filesystem::path& file) {
  std::vector<std::int64_t> times_ns;
  const auto lines = lines_of(file);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto time_ns = ns_from_seconds(without_blanks(lines[i]));
    if (!time_ns) {
      if (auto times = large_times(lines)) return *std::move(times);
      throw DatasetError(file, at_line(i) + " is not one time in seconds; is this times.txt?");
    }
    times_ns.push_back(*time_ns);
  }
  return understood(std::move(times_ns));
}

void write_kitti_times_ns(const std::filesystem::path& file,
                          std::span<const std::int64_t> times_ns) {
  std::ofstream out = text_file(file);
  for (const std::int64_t time_ns : times_ns) {
    // In whole numbers: a double cannot hold nanoseconds since 1970.
    const std::int64_t magnitude = std::abs(time_ns);
    out << (time_ns < 0 ? "-" : "") << magnitude / 1'000'000'000 << '.' << std::setw(9)
        << std::setfill('0') << magnitude % 1'000'000'000 << '\n';
  }
  finish(out, file);
}

std::vector<Eigen::Isometry3d> read_poses(const std::filesystem::path& file) {
  std::vector<Eigen::Isometry3d> poses;
  const auto lines = lines_of(file);
  poses.reserve(lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    poses.push_back(pose_from(file, at_line(i), numbers_in(lines[i])));
  }
  return poses;
}

void write_poses(const std::filesystem::path& file, std::span<const Eigen::Isometry3d> poses) {
  std::ofstream out = text_file(file);
  for (const auto& pose : poses) print_pose(out, pose);
  finish(out, file);
}

std::vector<Eigen::Isometry3d> lidar_poses_from_camera(
    std::span<const Eigen::Isometry3d> T_camera0_camera, const Eigen::Isometry3d& T_camera_lidar) {
  const Eigen::Isometry3d T_lidar_camera = T_camera_lidar.inverse();
  std::vector<Eigen::Isometry3d> poses;
  poses.reserve(T_camera0_camera.size());
  for (const auto& T : T_camera0_camera) poses.push_back(T_lidar_camera * T * T_camera_lidar);
  return poses;
}

std::vector<Eigen::Isometry3d> camera_poses_from_lidar(
    std::span<const Eigen::Isometry3d> T_lidar0_lidar, const Eigen::Isometry3d& T_camera_lidar) {
  return lidar_poses_from_camera(T_lidar0_lidar, T_camera_lidar.inverse());
}

}  // namespace stillmap
