#include "core/dataset/imu_file.hpp"

#include <array>
#include <charconv>
#include <fstream>
#include <iomanip>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/file_stamp.hpp"

namespace stillmap {
namespace {

constexpr std::string_view blanks_between = " \t\r";
constexpr std::size_t values_in_sample = 6;

/// The next word of the line, which is cut off it.
std::string_view take_word(std::string_view& line, std::string_view separators) {
  const std::size_t begin = line.find_first_not_of(separators);
  if (begin == std::string_view::npos) return line = {};
  line.remove_prefix(begin);
  const std::string_view word = line.substr(0, line.find_first_of(separators));
  line.remove_prefix(word.size());
  return word;
}

/// NaN and infinity are numbers: what becomes of such a sample is not the file's affair.
std::optional<double> number_in(std::string_view word) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

std::optional<std::int64_t> stamp_in(std::string_view word, bool in_nanoseconds) {
  if (!in_nanoseconds) return ns_from_seconds(word);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

std::optional<ImuSample> sample_in(std::string_view line, bool is_csv) {
  const std::string_view separators = is_csv ? ", \t\r" : blanks_between;
  const auto stamp_ns = stamp_in(take_word(line, separators), is_csv);
  if (!stamp_ns) return std::nullopt;
  std::array<double, values_in_sample> values{};
  for (double& value : values) {
    const auto number = number_in(take_word(line, separators));
    if (!number) return std::nullopt;
    value = *number;
  }
  const Eigen::Vector3d first(values[0], values[1], values[2]);
  const Eigen::Vector3d second(values[3], values[4], values[5]);
  if (is_csv) return ImuSample{*stamp_ns, first, second};
  return ImuSample{*stamp_ns, second, first};
}

}  // namespace

std::vector<ImuSample> read_imu_file(const std::filesystem::path& file) {
  const bool is_csv = file.extension() == ".csv";
  std::ifstream in(file);
  if (!in) throw DatasetError(file, "cannot be read; check its permissions");
  std::vector<ImuSample> samples;
  std::size_t number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    const std::size_t begin = line.find_first_not_of(blanks_between);
    if (begin == std::string::npos || line[begin] == '#') continue;
    const auto sample = sample_in(line, is_csv);
    if (!sample) {
      throw DatasetError(
          file, "line " + std::to_string(number) + " is not " +
                    (is_csv ? "a stamp in ns, three rates and three accelerations (EuRoC's layout)"
                            : "a stamp in s, three accelerations and three rates") +
                    "; mend or remove the line");
    }
    samples.push_back(*sample);
  }
  return samples;
}

void write_imu_csv(const std::filesystem::path& file, std::span<const ImuSample> samples) {
  std::ofstream out(file, std::ios::trunc);
  out << "#timestamp [ns],w_x [rad s^-1],w_y [rad s^-1],w_z [rad s^-1],a_x [m s^-2],a_y [m s^-2],"
         "a_z [m s^-2]\n"
      << std::setprecision(9);
  for (const ImuSample& sample : samples) {
    out << sample.stamp_ns;
    for (const double value : sample.angular_velocity_imu) out << ',' << value;
    for (const double value : sample.acceleration_imu) out << ',' << value;
    out << '\n';
  }
  out.close();
  if (!out) throw DatasetWriteError(file, "cannot be written; check the folder and the space left");
}

std::filesystem::path imu_file_in(const std::filesystem::path& folder) {
  for (const char* name : {"imu.csv", "imu.txt"}) {
    if (std::filesystem::exists(folder / name)) return folder / name;
  }
  return {};
}

}  // namespace stillmap
