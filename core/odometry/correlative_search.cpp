#include "core/odometry/correlative_search.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace stillmap {
namespace {

/// Layers of this height, the lowest so far below the lidar [m].
constexpr float layer_m = 2.0F;
constexpr float lowest_m = -6.0F;

/// A bit for each of eight layers; 0 outside them.
std::uint8_t layer_bit(float height_m) {
  const float layer = std::floor((height_m - lowest_m) / layer_m);
  return layer >= 0.0F && layer < 8.0F ? static_cast<std::uint8_t>(1U << static_cast<int>(layer))
                                       : std::uint8_t{0};
}

/// Which layers of which cells landmarks of the map occupy, round a place.
class OccupiedCells {
 public:
  OccupiedCells(std::span<const Eigen::Vector3f> landmarks_map, const Eigen::Vector3f& centre_map,
                int half_side, float cell_m)
      : side_(2 * half_side), half_side_(half_side), cells_(sized(side_), 0) {
    for (const Eigen::Vector3f& p_map : landmarks_map) {
      const Eigen::Vector3f p = p_map - centre_map;
      const auto x = static_cast<int>(std::floor(p.x() / cell_m)) + half_side_;
      const auto y = static_cast<int>(std::floor(p.y() / cell_m)) + half_side_;
      if (x < 0 || x >= side_ || y < 0 || y >= side_) continue;
      cells_[static_cast<std::size_t>(y * side_ + x)] |= layer_bit(p.z());
    }
  }

  /// A landmark of the scan, in cells from the centre.
  struct Landmark {
    int place = 0;
    std::uint8_t layer = 0;
  };
  [[nodiscard]] Landmark landmark(const Eigen::Vector3f& in_cells, std::uint8_t layer) const {
    const int x = static_cast<int>(std::floor(in_cells.x())) + half_side_;
    const int y = static_cast<int>(std::floor(in_cells.y())) + half_side_;
    return {y * side_ + x, layer};
  }

  /// Landmarks in occupied cells when the lidar is shifted by so many cells.
  [[nodiscard]] int hits(std::span<const Landmark> landmarks, int x, int y) const {
    const int shift = y * side_ + x;
    int hits = 0;
    for (const Landmark& l : landmarks)
      hits += (cells_[static_cast<std::size_t>(l.place + shift)] & l.layer) != 0 ? 1 : 0;
    return hits;
  }

 private:
  static std::size_t sized(int side) {
    return static_cast<std::size_t>(side) * static_cast<std::size_t>(side);
  }

  int side_;
  int half_side_;
  std::vector<std::uint8_t> cells_;
};

struct Candidate {
  int hits = 0;
  double heading_rad = 0.0;
  Eigen::Vector2d shift_m = Eigen::Vector2d::Zero();
};

/// The best shift for each of a few places of the grid: only one of neighbours can be a candidate.
constexpr int shifts_in_block = 3;

std::vector<Candidate> candidates_at(double heading_rad, const OccupiedCells& cells,
                                     std::span<const OccupiedCells::Landmark> landmarks, int reach,
                                     double cell_m) {
  std::vector<Candidate> found;
  for (int y0 = -reach; y0 <= reach; y0 += shifts_in_block) {
    for (int x0 = -reach; x0 <= reach; x0 += shifts_in_block) {
      Candidate best;
      for (int y = y0; y < std::min(y0 + shifts_in_block, reach + 1); ++y) {
        for (int x = x0; x < std::min(x0 + shifts_in_block, reach + 1); ++x) {
          const int hits = cells.hits(landmarks, x, y);
          if (hits > best.hits) best = {hits, heading_rad, Eigen::Vector2d(x, y) * cell_m};
        }
      }
      if (best.hits > 0) found.push_back(best);
    }
  }
  return found;
}

/// The best first; of equal ones those that are nearer and turned less.
bool is_better(const Candidate& a, const Candidate& b) {
  if (a.hits != b.hits) return a.hits > b.hits;
  return a.shift_m.norm() + std::abs(a.heading_rad) < b.shift_m.norm() + std::abs(b.heading_rad);
}

std::vector<Candidate> spread(std::vector<Candidate> candidates, std::size_t count,
                              const CorrelativeSearchConfig& config) {
  std::ranges::sort(candidates, is_better);
  std::vector<Candidate> kept;
  for (const Candidate& c : candidates) {
    if (kept.size() == count) break;
    const bool is_near = std::ranges::any_of(kept, [&](const Candidate& k) {
      const double turn = std::remainder(c.heading_rad - k.heading_rad, 2.0 * std::numbers::pi);
      return (c.shift_m - k.shift_m).norm() < config.spacing_m &&
             std::abs(turn) < config.spacing_rad;
    });
    if (!is_near) kept.push_back(c);
  }
  return kept;
}

/// Those within range, evenly thinned.
std::vector<Eigen::Vector3f> landmarks_in_range(std::span<const Eigen::Vector3f> landmarks_lidar,
                                                const CorrelativeSearchConfig& config) {
  std::vector<Eigen::Vector3f> near;
  for (const Eigen::Vector3f& p : landmarks_lidar)
    if (p.norm() < static_cast<float>(config.max_range_m)) near.push_back(p);
  if (near.size() <= config.max_landmarks) return near;
  for (std::size_t k = 0; k < config.max_landmarks; ++k)
    near[k] = near[k * near.size() / config.max_landmarks];
  near.resize(config.max_landmarks);
  return near;
}

}  // namespace

std::vector<Eigen::Isometry3d> correlative_search(std::span<const Eigen::Vector3f> landmarks_lidar,
                                                  std::span<const Eigen::Vector3f> landmarks_map,
                                                  const Eigen::Isometry3d& T_map_lidar_guess,
                                                  std::size_t count,
                                                  const CorrelativeSearchConfig& config) {
  const std::vector<Eigen::Vector3f> landmarks = landmarks_in_range(landmarks_lidar, config);
  const int reach = static_cast<int>(std::ceil(config.reach_m / config.cell_m));
  const int range = static_cast<int>(std::ceil(config.max_range_m / config.cell_m));
  const auto cell_m = static_cast<float>(config.cell_m);
  const Eigen::Vector3f centre_map = T_map_lidar_guess.translation().cast<float>();
  const OccupiedCells cells(landmarks_map, centre_map, reach + range + 2, cell_m);
  const auto headings =
      static_cast<std::size_t>(std::ceil(2.0 * std::numbers::pi / config.heading_step_rad));
  std::vector<std::vector<Candidate>> of_heading(headings);
  tbb::parallel_for(std::size_t{0}, headings, [&](std::size_t k) {
    const double heading_rad = std::remainder(
        2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(headings),
        2.0 * std::numbers::pi);
    const Eigen::Matrix3f R =
        (Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ()) * T_map_lidar_guess.linear())
            .cast<float>();
    std::vector<OccupiedCells::Landmark> turned;
    turned.reserve(landmarks.size());
    for (const Eigen::Vector3f& p_lidar : landmarks) {
      const Eigen::Vector3f p = R * p_lidar;
      if (const std::uint8_t layer = layer_bit(p.z()))
        turned.push_back(cells.landmark(p / cell_m, layer));
    }
    of_heading[k] =
        spread(candidates_at(heading_rad, cells, turned, reach, config.cell_m), count, config);
  });
  std::vector<Candidate> all;
  for (const auto& found : of_heading) all.insert(all.end(), found.begin(), found.end());
  std::vector<Eigen::Isometry3d> poses;
  for (const Candidate& c : spread(std::move(all), count, config)) {
    const Eigen::Vector3d shift(c.shift_m.x(), c.shift_m.y(), 0.0);
    Eigen::Isometry3d T = T_map_lidar_guess;
    T.linear() = Eigen::AngleAxisd(c.heading_rad, Eigen::Vector3d::UnitZ()) * T.linear();
    T.translation() += shift;
    poses.push_back(T);
  }
  return poses;
}

}  // namespace stillmap
