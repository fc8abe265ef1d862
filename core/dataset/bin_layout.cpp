#include "core/dataset/bin_layout.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/kitti_files.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// So much of each file is looked at: some ten thousand points.
constexpr std::size_t max_bytes = std::size_t{1} << 18U;
constexpr std::size_t kitti_values = 4;
constexpr std::size_t nuscenes_values = 5;
constexpr std::size_t kitti_bytes = kitti_values * sizeof(float);
constexpr std::size_t nuscenes_bytes = nuscenes_values * sizeof(float);
/// Fewer values that repeat, or do not, are chance.
constexpr std::size_t min_pairs = 1000;
/// Another layout must fit so much better than KITTI's.
constexpr double clearly_better = 0.6;
/// A share of numbers that are no metres is noise where it is above this, and none below that.
constexpr double much_noise = 0.05;
constexpr double no_noise = 0.01;
constexpr double mostly_noise = 0.5;
/// So many numbers next to zero have whole numbers that are read as floating point, and no
/// coordinates in any unit, or of any frame.
constexpr double many_next_to_zero = 0.2;

/// The beginning of a file.
struct Beginning {
  std::vector<char> bytes;
  std::uintmax_t file_bytes = 0;
  /// Its float32 values, so that near differences count and far ones do not count for more than
  /// they are. NaN of those that say nothing: infinite ones, and zeros, which stand for missing
  /// points.
  std::vector<float> scaled;

  template <class T>
  [[nodiscard]] T value(std::size_t offset) const {
    T value{};
    std::memcpy(&value, bytes.data() + offset, sizeof value);
    return value;
  }
};

float scaled(float value) {
  if (value == 0.0F || !std::isfinite(value)) return std::numeric_limits<float>::quiet_NaN();
  return std::clamp(std::asinh(value), -13.0F, 13.0F);
}

std::vector<Beginning> beginnings_of(std::span<const fs::path> files) {
  std::vector<Beginning> beginnings;
  for (const fs::path& file : files) {
    std::error_code error;
    const std::uintmax_t size = fs::file_size(file, error);
    if (error || size == 0) continue;
    Beginning one{.bytes = std::vector<char>(std::min<std::uintmax_t>(size, max_bytes)),
                  .file_bytes = size,
                  .scaled = {}};
    std::ifstream in(file, std::ios::binary);
    if (!in.read(one.bytes.data(), static_cast<std::streamsize>(one.bytes.size()))) continue;
    for (std::size_t at = 0; at + sizeof(float) <= one.bytes.size(); at += sizeof(float))
      one.scaled.push_back(scaled(one.value<float>(at)));
    beginnings.push_back(std::move(one));
  }
  return beginnings;
}

/// Whether files of points of so many bytes have these sizes; one in a few may be cut off.
bool fits_sizes(const std::vector<Beginning>& files, std::size_t point_bytes) {
  const auto fitting = std::ranges::count_if(
      files, [=](const Beginning& file) { return file.file_bytes % point_bytes == 0; });
  return 2 * static_cast<std::size_t>(fitting) > files.size();
}

bool is_next_to_zero(double value) {
  const double size = std::abs(value);
  return size > 0.0 && size < 1e-6;
}

/// Neither zero nor of the size of a coordinate in metres, as other numbers are when they are read
/// as floating point.
bool is_noise(double value) {
  const double size = std::abs(value);
  return std::isfinite(value) && (is_next_to_zero(value) || size > 1e5);
}

/// Share of noise among `values` numbers at the beginning of every `point_bytes`.
template <class T>
double noise(const std::vector<Beginning>& files, std::size_t point_bytes, std::size_t values) {
  std::size_t seen = 0, bad = 0;
  for (const Beginning& file : files) {
    for (std::size_t at = 0; at + point_bytes <= file.bytes.size(); at += point_bytes) {
      for (std::size_t k = 0; k < values; ++k) {
        const auto value = static_cast<double>(file.value<T>(at + k * sizeof(T)));
        bad += is_noise(value) || (sizeof(T) > 4 && !std::isfinite(value)) ? 1U : 0U;
        ++seen;
      }
    }
  }
  return seen == 0 ? 1.0 : static_cast<double>(bad) / static_cast<double>(seen);
}

/// Share of float32 values that are all but zero.
double share_next_to_zero(const std::vector<Beginning>& files) {
  std::size_t seen = 0, found = 0;
  for (const Beginning& file : files) {
    for (std::size_t at = 0; at + sizeof(float) <= file.bytes.size(); at += sizeof(float)) {
      found += is_next_to_zero(double{file.value<float>(at)}) ? 1U : 0U;
      ++seen;
    }
  }
  return seen == 0 ? 0.0 : static_cast<double>(found) / static_cast<double>(seen);
}

/// How far float32 values are apart that lie so many values apart.
struct Differences {
  /// By the places of the values in KITTI's points: sums, and numbers of pairs.
  std::array<std::array<double, kitti_values>, kitti_values> sums{};
  std::array<std::array<double, kitti_values>, kitti_values> pairs{};
  double sum = 0.0;
  double pair_count = 0.0;

  [[nodiscard]] double mean() const { return sum / pair_count; }
};

/// Nothing of too few pairs.
std::optional<Differences> differences(const std::vector<Beginning>& files, std::size_t step) {
  Differences found;
  for (const Beginning& file : files) {
    for (std::size_t i = 0; i + step < file.scaled.size(); ++i) {
      const float apart = std::abs(file.scaled[i] - file.scaled[i + step]);
      if (std::isnan(apart)) continue;
      found.sums[i % kitti_values][(i + step) % kitti_values] += double{apart};
      found.pairs[i % kitti_values][(i + step) % kitti_values] += 1.0;
    }
  }
  for (std::size_t a = 0; a < kitti_values; ++a) {
    for (std::size_t b = 0; b < kitti_values; ++b) {
      found.sum += found.sums[a][b];
      found.pair_count += found.pairs[a][b];
    }
  }
  if (found.pair_count < static_cast<double>(min_pairs)) return std::nullopt;
  return found;
}

/// The same from a point to the next, or to the one after it, where two beams take turns.
std::optional<Differences> differences_of_points(const std::vector<Beginning>& files,
                                                 std::size_t values) {
  const auto next = differences(files, values), second = differences(files, 2 * values);
  if (!next || !second) return std::nullopt;
  return next->mean() < second->mean() ? next : second;
}

/// How much farther apart values are than they would be if the points were KITTI's, in no order:
/// below 1 they are of another layout. In any order two values of one column are as far apart on
/// average as the column's are, and of two columns no less than the mean of both. Columns of which
/// little is there, as an intensity that is 0, have as little weight here as they have there: else
/// leaving them out would look like a better layout.
double relative_to_kitti(const Differences& found, const Differences& as_kitti) {
  const auto of_column = [&](std::size_t k) {
    return as_kitti.pairs[k][k] > 0.0 ? as_kitti.sums[k][k] / as_kitti.pairs[k][k]
                                      : as_kitti.mean();
  };
  double expected = 0.0;
  for (std::size_t a = 0; a < kitti_values; ++a) {
    for (std::size_t b = 0; b < kitti_values; ++b)
      expected += found.pairs[a][b] * 0.5 * (of_column(a) + of_column(b));
  }
  return expected > 0.0 ? found.sum / expected : 1.0;
}

/// Whether every fifth value is a ring's number.
bool has_rings(const std::vector<Beginning>& files) {
  constexpr float max_ring = 127.0F;
  for (const Beginning& file : files) {
    if (file.file_bytes % nuscenes_bytes != 0) continue;
    for (std::size_t at = 0; at + nuscenes_bytes <= file.bytes.size(); at += nuscenes_bytes) {
      const auto ring = file.value<float>(at + kitti_bytes);
      if (!(ring >= 0.0F && ring <= max_ring && ring == std::floor(ring))) return false;
    }
  }
  return true;
}

bool is_nuscenes(std::span<const fs::path> names, const std::vector<Beginning>& files,
                 const std::optional<Differences>& as_kitti) {
  if (!fits_sizes(files, nuscenes_bytes) || !has_rings(files)) return false;
  const bool is_named = std::ranges::all_of(
      names, [](const fs::path& name) { return name.string().ends_with(".pcd.bin"); });
  const auto as_nuscenes = differences_of_points(files, nuscenes_values);
  if (!as_kitti || !as_nuscenes) return is_named;
  return relative_to_kitti(*as_nuscenes, *as_kitti) < (is_named ? 1.0 : clearly_better);
}

/// How points are laid out that are not as KITTI's, and numpy's words that make them so; none where
/// these are not known.
struct OtherLayout {
  std::string in_words;
  std::string conversion;
};

OtherLayout of_floats(std::size_t values) {
  const std::string count = std::to_string(values);
  if (values == 1) {
    // As RobotCar's.
    return {"all x, then all y, all z and all intensities, as float32",
            "np.fromfile('IN.bin', 'f4').reshape(4, -1).T"};
  }
  if (values == 3) {
    // Without intensity: 0.
    return {"x y z as float32 without intensity",
            "np.pad(np.fromfile('IN.bin', 'f4').reshape(-1, 3), ((0, 0), (0, 1)))"};
  }
  return {count + " values of float32 a point",
          "np.fromfile('IN.bin', 'f4').reshape(-1, " + count + ")[:, :4]"};
}

/// Whether what repeats after six values are two points of three: their columns are alike.
bool are_two_of_three(const std::vector<Beginning>& files) {
  constexpr std::size_t values = 6;
  if (!fits_sizes(files, values * sizeof(float))) return true;
  std::array<double, values> sums{};
  for (const Beginning& file : files) {
    for (std::size_t i = 0; i < file.scaled.size(); ++i)
      if (!std::isnan(file.scaled[i])) sums[i % values] += std::abs(double{file.scaled[i]});
  }
  constexpr double alike = 1.25;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto [less, more] = std::minmax(sums[k], sums[k + 3]);
    if (more > alike * less) return false;
  }
  return true;
}

/// Whether of the values at each place of KITTI's points many are negative, as no intensities are.
bool have_negatives_everywhere(const std::vector<Beginning>& files) {
  constexpr std::size_t one_in = 10;
  std::array<std::size_t, kitti_values> seen{}, negative{};
  for (const Beginning& file : files) {
    for (std::size_t i = 0; i < file.scaled.size(); ++i) {
      if (std::isnan(file.scaled[i])) continue;
      ++seen[i % kitti_values];
      negative[i % kitti_values] += file.scaled[i] < 0.0F ? 1 : 0;
    }
  }
  for (std::size_t k = 0; k < kitti_values; ++k)
    if (seen[k] == 0 || one_in * negative[k] < seen[k]) return false;
  return fits_sizes(files, kitti_bytes);
}

/// Where most numbers repeat after another number of float32 values than KITTI's.
std::optional<OtherLayout> other_floats(const std::vector<Beginning>& files,
                                        const Differences& as_kitti) {
  std::optional<std::size_t> best;
  double least = clearly_better;
  for (const std::size_t values : {1U, 3U, 5U, 6U, 7U}) {
    if (!fits_sizes(files, values * sizeof(float))) continue;
    if (values == 1 && !have_negatives_everywhere(files)) continue;
    // Twice six is three of KITTI's points.
    const auto found =
        values == 6 ? differences(files, values) : differences_of_points(files, values);
    if (!found) continue;
    const double relative = relative_to_kitti(*found, as_kitti);
    if (relative >= least) continue;
    least = relative;
    best = values;
  }
  if (!best) return std::nullopt;
  if (*best == 3 && !are_two_of_three(files)) best = 6;
  return of_floats(*best);
}

bool are_many_values(const std::vector<Beginning>& files) {
  return std::ranges::any_of(files,
                             [](const Beginning& file) { return file.scaled.size() >= min_pairs; });
}

/// Where what would be float32 is noise and, read otherwise, is not, or nearly all of it is.
std::optional<OtherLayout> other_numbers(const std::vector<Beginning>& files) {
  const double noise_share = noise<float>(files, sizeof(float), 1);
  if (noise_share < much_noise) return std::nullopt;
  if (fits_sizes(files, 4 * sizeof(double)) && noise<double>(files, sizeof(double), 1) < no_noise) {
    return OtherLayout{"x y z intensity as float64", "np.fromfile('IN.bin', 'f8').astype('f4')"};
  }
  constexpr std::size_t least = 13, most = 64;
  for (std::size_t bytes = least; bytes <= most; ++bytes) {
    if (!fits_sizes(files, bytes) || noise<float>(files, bytes, 3) >= no_noise) continue;
    // KITTI's but for the intensity.
    if (bytes == kitti_bytes) return std::nullopt;
    const std::string count = std::to_string(bytes);
    return OtherLayout{
        count + " bytes a point, of which the first are x y z as float32",
        "np.fromfile('IN.bin', 'u1').reshape(-1, " + count + ")[:, :16].copy().view('f4')"};
  }
  if (noise_share < mostly_noise || share_next_to_zero(files) < many_next_to_zero ||
      !are_many_values(files))
    return std::nullopt;
  return OtherLayout{"numbers that are no float32, such as NCLT's, which have 16 bits", {}};
}

}  // namespace

BinLayout bin_layout_of(std::span<const fs::path> files) {
  const std::vector<Beginning> beginnings = beginnings_of(files);
  if (beginnings.empty()) return BinLayout::kitti;
  const auto as_kitti = differences_of_points(beginnings, kitti_values);
  if (is_nuscenes(files, beginnings, as_kitti)) return BinLayout::nuscenes;
  std::optional<OtherLayout> other = other_numbers(beginnings);
  if (!other && as_kitti) other = other_floats(beginnings, *as_kitti);
  if (!other) return BinLayout::kitti;
  const std::string converted =
      other->conversion.empty()
          ? "convert them to that"
          : "python3 -c \"import numpy as np; a = " + other->conversion +
                "; a.tofile('OUT.bin')\" converts a file whose fourth value is the intensity";
  throw DatasetError(files.front(), "looks like " + other->in_words +
                                        ", not like KITTI's x y z intensity as float32, and would "
                                        "be read as noise; " +
                                        converted + "; .pcd and .ply name their values");
}

Scan read_bin(const fs::path& file, BinLayout layout) {
  if (layout == BinLayout::kitti) return read_kitti_bin(file);
  const auto values = read_values<float>(file, nuscenes_values);
  Scan scan;
  for (std::size_t i = 0; i < values.size(); i += nuscenes_values) {
    scan.points_lidar.emplace_back(values[i], values[i + 1], values[i + 2]);
    scan.intensity.push_back(values[i + 3]);
    const float ring = values[i + 4];
    const bool is_number = ring >= 0.0F && ring <= 65535.0F;
    scan.ring.push_back(is_number ? static_cast<std::uint16_t>(ring) : std::uint16_t{0});
  }
  return scan;
}

}  // namespace stillmap
