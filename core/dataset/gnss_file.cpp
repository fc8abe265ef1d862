#include "core/dataset/gnss_file.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "core/dataset/dataset_error.hpp"

namespace stillmap {
namespace {

constexpr std::string_view separators = ", \t\r";

/// Takes the next number off the line. NaN is one: a receiver may not know its altitude.
template <typename Number>
bool take(std::string_view& line, Number& value) {
  const std::size_t begin = line.find_first_not_of(separators);
  if (begin == std::string_view::npos) return false;
  line.remove_prefix(begin);
  const std::size_t length = std::min(line.find_first_of(separators), line.size());
  const auto [end, error] = std::from_chars(line.data(), line.data() + length, value);
  const bool is_number = error == std::errc{} && end == line.data() + length;
  line.remove_prefix(length);
  return is_number;
}

std::optional<GnssFix> fix_in(std::string_view line) {
  GnssFix fix;
  std::array<double, 3> sigma_enu_m{};
  const bool is_fix = take(line, fix.stamp_ns) && take(line, fix.latitude_deg) &&
                      take(line, fix.longitude_deg) && take(line, fix.altitude_m) &&
                      take(line, sigma_enu_m[0]) && take(line, sigma_enu_m[1]) &&
                      take(line, sigma_enu_m[2]);
  if (!is_fix) return std::nullopt;
  const Eigen::Map<const Eigen::Vector3d> sigma(sigma_enu_m.data());
  fix.covariance_enu = sigma.cwiseAbs2().asDiagonal();
  return fix;
}

}  // namespace

std::vector<GnssFix> read_gnss_csv(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw DatasetError(file, "cannot be read; check its permissions");
  std::vector<GnssFix> fixes;
  std::size_t number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    const std::size_t begin = line.find_first_not_of(separators);
    if (begin == std::string::npos || line[begin] == '#') continue;
    const auto fix = fix_in(line);
    if (!fix) {
      throw DatasetError(file, "line " + std::to_string(number) +
                                   " is not a stamp in ns, latitude, longitude, altitude and three "
                                   "standard deviations; mend or remove the line");
    }
    fixes.push_back(*fix);
  }
  return fixes;
}

void write_gnss_csv(const std::filesystem::path& file, std::span<const GnssFix> fixes) {
  // A hundred-millionth of a degree is a millimetre.
  constexpr int degree_digits = 9;
  constexpr int metre_digits = 4;
  std::ofstream out(file, std::ios::trunc);
  out << "#timestamp [ns],latitude [deg],longitude [deg],altitude [m],sigma_east [m],"
         "sigma_north [m],sigma_up [m]\n"
      << std::fixed;
  for (const GnssFix& fix : fixes) {
    out << fix.stamp_ns << ',' << std::setprecision(degree_digits) << fix.latitude_deg << ','
        << fix.longitude_deg << ',' << std::setprecision(metre_digits) << fix.altitude_m;
    for (int axis = 0; axis < 3; ++axis) out << ',' << std::sqrt(fix.covariance_enu(axis, axis));
    out << '\n';
  }
  out.close();
  if (!out) throw DatasetWriteError(file, "cannot be written; check the folder and the space left");
}

}  // namespace stillmap
