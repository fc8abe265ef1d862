#include "core/segmentation/island_votes.hpp"

#include <tsl/robin_map.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <sstream>
#include <vector>

#include "core/lidar/semantic_class.hpp"
#include "core/lidar/voxel_index.hpp"

namespace stillmap {
namespace {

bool is_vehicle(SemanticClass label) {
  return label >= SemanticClass::car && label <= SemanticClass::other_vehicle;
}

/// Bicycles and motorcycles lean on walls and fences: they are no islands.
bool stands_apart(SemanticClass label) {
  return label == SemanticClass::car || label == SemanticClass::truck ||
         label == SemanticClass::other_vehicle;
}

/// Of what stands on the ground and is no vehicle.
bool is_surroundings(SemanticClass label) {
  return label != SemanticClass::unlabeled && !is_vehicle(label) && !is_ground(label);
}

struct Votes {
  std::array<float, semantic_class_count> of_class{};
  float all = 0.0F;
  /// Of those that do not stand between the vehicle and the lidar.
  float not_before = 0.0F;
  std::uint32_t points = 0;

  void add(SemanticClass label, float confidence, bool is_before) {
    of_class[static_cast<std::size_t>(label)] += confidence;
    all += confidence;
    if (!is_before) not_before += confidence;
    ++points;
  }
  void add(const Votes& other) {
    if (other.points == 0) return;
    for (std::size_t k = 0; k < of_class.size(); ++k) of_class[k] += other.of_class[k];
    all += other.all;
    not_before += other.not_before;
    points += other.points;
  }
};

/// The cubes that vehicles touch, and those beside their sides.
class Cubes {
 public:
  Cubes(std::span<const Eigen::Vector3f> points, double edge_m, const PointLabels& labels)
      : per_m_(static_cast<float>(1.0 / edge_m)), points_(points), labels_(labels) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!stands_apart(labels.classes[i])) continue;
      if (const auto key = key_of(points[i]))
        vehicle_points_.push_back({.point = i, .cube = number_of(*key)});
    }
    vehicle_cubes_ = keys_.size();
    own_.resize(vehicle_cubes_);
    for (const VehiclePoint& p : vehicle_points_) {
      own_[p.cube].votes += labels.confidence[p.point];
      own_[p.cube].ranges_m += points[p.point].norm();
      ++own_[p.cube].points;
    }
    for (std::size_t k = 0; k < vehicle_cubes_; ++k) {
      for (const std::uint64_t side : sides(keys_[k])) number_of(side);
    }
    around_.resize(keys_.size());
    if (vehicle_cubes_ > 0) let_surroundings_vote();
  }

  struct VehiclePoint {
    std::size_t point;
    std::uint32_t cube;
  };
  [[nodiscard]] std::span<const VehiclePoint> vehicle_points() const { return vehicle_points_; }

  [[nodiscard]] std::size_t size() const { return keys_.size(); }
  /// The first so many hold points of vehicles.
  [[nodiscard]] std::size_t vehicle_cubes() const { return vehicle_cubes_; }
  struct Own {
    float votes = 0.0F;
    float ranges_m = 0.0F;
    std::uint32_t points = 0;
  };
  [[nodiscard]] const Own& own(std::size_t k) const { return own_[k]; }
  /// Of the surroundings in any cube.
  [[nodiscard]] const Votes& around(std::size_t k) const { return around_[k]; }

  /// Cubes with vehicles that touch this one.
  template <typename Visit>
  void for_each_touching(std::size_t k, Visit visit) const {
    const auto [x, y, z] = unpacked_index(keys_[k]);
    for (int i = 0; i < 27; ++i) {
      const auto found =
          numbers_.find(packed_index(x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1));
      if (found != numbers_.end() && found->second < vehicle_cubes_) visit(found->second);
    }
  }
  /// The cube itself and those beside its sides.
  template <typename Visit>
  void for_each_beside(std::size_t k, Visit visit) const {
    visit(k);
    for (const std::uint64_t side : sides(keys_[k])) visit(numbers_.at(side));
  }

 private:
  static std::array<std::uint64_t, 6> sides(std::uint64_t key) {
    const auto [x, y, z] = unpacked_index(key);
    return {packed_index(x - 1, y, z), packed_index(x + 1, y, z), packed_index(x, y - 1, z),
            packed_index(x, y + 1, z), packed_index(x, y, z - 1), packed_index(x, y, z + 1)};
  }

  [[nodiscard]] std::optional<std::uint64_t> key_of(const Eigen::Vector3f& p) const {
    constexpr float farthest = 1e6F;
    const Eigen::Array3f cell = (p.array() * per_m_).floor();
    // Not by the largest, which may leave out one that is no number.
    if (!(cell.abs() < farthest).all()) return std::nullopt;
    return packed_index(static_cast<std::int64_t>(cell.x()), static_cast<std::int64_t>(cell.y()),
                        static_cast<std::int64_t>(cell.z()));
  }

  std::uint32_t number_of(std::uint64_t key) {
    const auto [entry, is_new] =
        numbers_.try_emplace(key, static_cast<std::uint32_t>(keys_.size()));
    if (is_new) keys_.push_back(key);
    return entry->second;
  }

  /// How far from the lidar the points of vehicles are in each cube and those beside it [m].
  [[nodiscard]] std::vector<float> mean_ranges_m() const {
    std::vector<float> means(keys_.size());
    for (std::size_t k = 0; k < keys_.size(); ++k) {
      Own near;
      const auto add = [&](std::size_t other) {
        near.ranges_m += own_[other].ranges_m;
        near.points += own_[other].points;
      };
      if (k < vehicle_cubes_) add(k);
      for (const std::uint64_t side : sides(keys_[k])) {
        const auto found = numbers_.find(side);
        if (found != numbers_.end() && found->second < vehicle_cubes_) add(found->second);
      }
      means[k] = near.ranges_m / static_cast<float>(near.points);
    }
    return means;
  }

  void let_surroundings_vote() {
    // Most points are nowhere near a vehicle: a look at a small table spares them the large one.
    constexpr std::size_t marks = std::size_t{1} << 16;
    std::vector<bool> is_near(marks);
    for (const std::uint64_t key : keys_) is_near[IndexHash()(key) % marks] = true;
    const std::vector<float> vehicle_m = mean_ranges_m();
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (!is_surroundings(labels_.classes[i])) continue;
      const auto key = key_of(points_[i]);
      if (!key || !is_near[IndexHash()(*key) % marks]) continue;
      const auto found = numbers_.find(*key);
      if (found == numbers_.end()) continue;
      around_[found->second].add(labels_.classes[i], labels_.confidence[i],
                                 points_[i].norm() < vehicle_m[found->second]);
    }
  }

  float per_m_;
  std::span<const Eigen::Vector3f> points_;
  const PointLabels& labels_;
  tsl::robin_map<std::uint64_t, std::uint32_t, IndexHash> numbers_;
  /// Of each cube by its number.
  std::vector<std::uint64_t> keys_;
  std::vector<Own> own_;
  std::vector<Votes> around_;
  std::vector<VehiclePoint> vehicle_points_;
  std::size_t vehicle_cubes_ = 0;
};

/// What an island becomes.
struct Verdict {
  /// Unlabeled: it stays.
  SemanticClass label = SemanticClass::unlabeled;
  float confidence = 0.0F;
};

/// The verdict of the island that each cube with vehicles is of.
class Islands {
 public:
  Islands(const Cubes& cubes, double share)
      : cubes_(cubes),
        share_(static_cast<float>(share)),
        island_(cubes.vehicle_cubes(), none),
        last_beside_(cubes.size(), none) {
    for (std::size_t first = 0; first < cubes.vehicle_cubes(); ++first) {
      if (island_[first] == none) judge_island_of(first);
    }
  }

  [[nodiscard]] const Verdict& verdict(std::size_t cube) const { return verdicts_[island_[cube]]; }

 private:
  static constexpr auto none = static_cast<std::size_t>(-1);

  void judge_island_of(std::size_t first) {
    const std::size_t number = verdicts_.size();
    std::vector<std::size_t> cubes;
    const auto add = [&](std::size_t k) {
      if (island_[k] != none) return;
      island_[k] = number;
      cubes.push_back(k);
    };
    add(first);
    for (std::size_t i = 0; i < cubes.size(); ++i) cubes_.for_each_touching(cubes[i], add);
    Cubes::Own own;
    Votes around;
    for (const std::size_t k : cubes) {
      own.votes += cubes_.own(k).votes;
      own.points += cubes_.own(k).points;
      cubes_.for_each_beside(k, [&](std::size_t other) {
        if (last_beside_[other] == number) return;
        last_beside_[other] = number;
        around.add(cubes_.around(other));
      });
    }
    verdicts_.push_back(verdict_of(own, around));
  }

  [[nodiscard]] Verdict verdict_of(const Cubes::Own& own, const Votes& around) const {
    // Of a hedge or wall that an island is a part of, about half lies farther away than it; of a
    // mesh or hedge before a car, next to nothing.
    constexpr float min_not_before = 0.25F;
    if (!(around.all > 0.0F && around.all >= share_ * own.votes)) return {};
    if (around.not_before < min_not_before * around.all) return {};
    const auto most = std::ranges::max_element(around.of_class);
    return {.label = static_cast<SemanticClass>(most - around.of_class.begin()),
            .confidence = *most / static_cast<float>(around.points + own.points)};
  }

  const Cubes& cubes_;
  float share_;
  /// Of each cube with vehicles.
  std::vector<std::size_t> island_;
  /// Of each cube: the last island that it was counted for.
  std::vector<std::size_t> last_beside_;
  std::vector<Verdict> verdicts_;
};

}  // namespace

std::string IslandVoteConfig::faults() const {
  std::ostringstream faults;
  if (!(edge_m > 0.0 && std::isfinite(edge_m)))
    faults << "edge_m = " << edge_m << "; must be above 0\n";
  if (!(share > 0.0 && std::isfinite(share)))
    faults << "share = " << share << "; must be above 0\n";
  return faults.str();
}

void vote_on_islands(std::span<const Eigen::Vector3f> points_lidar, const IslandVoteConfig& config,
                     PointLabels& labels) {
  assert(config.faults().empty());
  assert(labels.classes.size() == points_lidar.size());
  const Cubes cubes(points_lidar, config.edge_m, labels);
  const Islands islands(cubes, config.share);
  for (const Cubes::VehiclePoint& p : cubes.vehicle_points()) {
    const Verdict& verdict = islands.verdict(p.cube);
    if (verdict.label == SemanticClass::unlabeled) continue;
    labels.classes[p.point] = verdict.label;
    labels.confidence[p.point] = verdict.confidence;
  }
}

}  // namespace stillmap
