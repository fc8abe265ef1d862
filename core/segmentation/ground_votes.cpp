#include "core/segmentation/ground_votes.hpp"

#include <tsl/robin_map.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/lidar/semantic_class.hpp"
#include "core/lidar/voxel_index.hpp"

namespace stillmap {
namespace {

bool is_large_vehicle(SemanticClass label) {
  return label == SemanticClass::car || label == SemanticClass::truck ||
         label == SemanticClass::other_vehicle;
}

/// Points of ground: what a plane through them, and their class, need.
struct GroundPoints {
  std::array<float, semantic_class_count> votes{};
  double count = 0.0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  /// xx, xy, yy, xz, yz, zz.
  std::array<double, 6> products{};

  void add(const Eigen::Vector3d& p, SemanticClass label, float confidence) {
    votes[static_cast<std::size_t>(label)] += confidence;
    count += 1.0;
    sum += p;
    const std::array<double, 6> of_point{p.x() * p.x(), p.x() * p.y(), p.y() * p.y(),
                                         p.x() * p.z(), p.y() * p.z(), p.z() * p.z()};
    for (std::size_t k = 0; k < products.size(); ++k) products[k] += of_point[k];
  }
  void add(const GroundPoints& other) {
    for (std::size_t k = 0; k < votes.size(); ++k) votes[k] += other.votes[k];
    count += other.count;
    sum += other.sum;
    for (std::size_t k = 0; k < products.size(); ++k) products[k] += other.products[k];
  }
};

/// The ground around a cell.
struct Ground {
  SemanticClass label = SemanticClass::unlabeled;
  float confidence = 0.0F;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  /// Rise along x and y.
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();

  [[nodiscard]] double height_of_m(const Eigen::Vector3d& p) const {
    return p.z() - middle.z() - slope.dot((p - middle).head<2>());
  }
};

std::optional<Ground> ground_through(const GroundPoints& points) {
  constexpr double min_points = 5.0;
  // Across the beams of a lidar points may lie on one line: a slope that they do not show is none.
  constexpr double flat_m2 = 0.02;
  constexpr double max_deviation_m = 0.06;
  if (points.count < min_points) return std::nullopt;
  Ground ground;
  ground.middle = points.sum / points.count;
  const auto& m = ground.middle;
  const auto& p = points.products;
  const auto moment = [&](std::size_t k, double a, double b) {
    return p[k] / points.count - a * b;
  };
  const double xx = moment(0, m.x(), m.x()), xy = moment(1, m.x(), m.y()),
               yy = moment(2, m.y(), m.y()), zz = moment(5, m.z(), m.z());
  const Eigen::Vector2d z(moment(3, m.x(), m.z()), moment(4, m.y(), m.z()));
  Eigen::Matrix2d spread;
  spread << xx + flat_m2, xy, xy, yy + flat_m2;
  ground.slope = spread.inverse() * z;
  if (zz - ground.slope.dot(z) > max_deviation_m * max_deviation_m) return std::nullopt;
  const auto most = std::ranges::max_element(points.votes);
  ground.label = static_cast<SemanticClass>(most - points.votes.begin());
  ground.confidence = *most / static_cast<float>(points.count);
  return ground;
}

/// The square metres that vehicles stand on, and those around.
class Cells {
 public:
  Cells(std::span<const Eigen::Vector3f> points, const PointLabels& labels) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!is_large_vehicle(labels.classes[i])) continue;
      if (const auto key = key_of(points[i]))
        vehicle_points_.push_back({.point = i, .cell = number_of(*key)});
    }
    const std::size_t below_vehicles = keys_.size();
    around_.resize(below_vehicles);
    for (std::size_t k = 0; k < below_vehicles; ++k) {
      const auto [x, y, z] = unpacked_index(keys_[k]);
      for (int i = 0; i < 9; ++i)
        around_[k][static_cast<std::size_t>(i)] =
            number_of(packed_index(x + i % 3 - 1, y + i / 3 - 1, 0));
    }
    if (below_vehicles > 0) add_ground(points, labels);
  }

  struct VehiclePoint {
    std::size_t point;
    std::uint32_t cell;
  };
  [[nodiscard]] std::span<const VehiclePoint> vehicle_points() const { return vehicle_points_; }

  /// Of each cell with vehicles, by its number.
  [[nodiscard]] std::vector<std::optional<Ground>> grounds() const {
    std::vector<std::optional<Ground>> grounds;
    for (const auto& cells : around_) {
      GroundPoints points;
      for (const std::uint32_t cell : cells) points.add(ground_[cell]);
      grounds.push_back(ground_through(points));
    }
    return grounds;
  }

 private:
  [[nodiscard]] static std::optional<std::uint64_t> key_of(const Eigen::Vector3f& p) {
    // A cell is a square metre.
    constexpr float farthest = 1e6F;
    const Eigen::Array2f cell = p.head<2>().array().floor();
    if (!(cell.abs() < farthest).all() || !std::isfinite(p.z())) return std::nullopt;
    return packed_index(static_cast<std::int64_t>(cell.x()), static_cast<std::int64_t>(cell.y()),
                        0);
  }

  std::uint32_t number_of(std::uint64_t key) {
    const auto [entry, is_new] =
        numbers_.try_emplace(key, static_cast<std::uint32_t>(keys_.size()));
    if (is_new) keys_.push_back(key);
    return entry->second;
  }

  void add_ground(std::span<const Eigen::Vector3f> points, const PointLabels& labels) {
    ground_.resize(keys_.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!is_ground(labels.classes[i])) continue;
      const auto key = key_of(points[i]);
      if (!key) continue;
      const auto found = numbers_.find(*key);
      if (found == numbers_.end()) continue;
      ground_[found->second].add(points[i].cast<double>(), labels.classes[i], labels.confidence[i]);
    }
  }

  tsl::robin_map<std::uint64_t, std::uint32_t, IndexHash> numbers_;
  /// Of each cell by its number: first those with vehicles.
  std::vector<std::uint64_t> keys_;
  std::vector<std::array<std::uint32_t, 9>> around_;
  std::vector<GroundPoints> ground_;
  std::vector<VehiclePoint> vehicle_points_;
};

}  // namespace

void vote_below_vehicles(std::span<const Eigen::Vector3f> points, PointLabels& labels) {
  constexpr double above_m = 0.02, below_m = 0.2;
  assert(labels.classes.size() == points.size());
  const Cells cells(points, labels);
  const std::vector<std::optional<Ground>> grounds = cells.grounds();
  for (const Cells::VehiclePoint& p : cells.vehicle_points()) {
    const std::optional<Ground>& ground = grounds[p.cell];
    if (!ground) continue;
    const double height_m = ground->height_of_m(points[p.point].cast<double>());
    if (height_m >= above_m || height_m < -below_m) continue;
    labels.classes[p.point] = ground->label;
    labels.confidence[p.point] = ground->confidence;
  }
}

}  // namespace stillmap
