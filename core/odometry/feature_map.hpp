#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/lidar/brick_index.hpp"
#include "core/lidar/prefetch.hpp"
#include "core/lidar/semantic_class.hpp"
#include "core/odometry/odometry_config.hpp"

namespace stillmap {

struct LabelledPoint {
  Eigen::Vector3f position_map;
  SemanticClass label = SemanticClass::unlabeled;
};

/// The nearest points of a feature map, nearest first.
struct Neighbours {
  static constexpr int capacity = 16;
  std::array<LabelledPoint, capacity> points;
  std::array<float, capacity> squared_distance;
  int count = 0;
};

/// One of the paper's local feature sets, M_e or M_p: labelled points in a voxel hash with a
/// bounded number of points a voxel. NOT safe for one writer beside readers; many readers are fine.
class FeatureMap {
 public:
  explicit FeatureMap(const LocalMapConfig& config);

  /// Adds points that have no other point of their voxel within `min_spacing_m`, while it has room.
  void insert(std::span<const LabelledPoint> points);

  /// The `n` <= Neighbours::capacity nearest points within `max_distance_m`, which is at most the
  /// voxel size.
  [[nodiscard]] Neighbours nearest(const Eigen::Vector3f& position_map, int n,
                                   float max_distance_m) const;

  /// Asks for the memory that `nearest` will read first at this place.
  void prefetch_near(const Eigen::Vector3f& position_map) const;

  /// Removes voxels whose first point is farther than the configured radius from `centre_map`,
  /// where that has moved by a fiftieth of the radius since it was last done.
  void remove_far_from(const Eigen::Vector3f& centre_map);

  /// Removes the movable points for which `is_gone(position_map)` holds.
  template <typename Predicate>
  void remove_movable_if(Predicate is_gone);

  /// All points, in no particular order.
  [[nodiscard]] std::vector<LabelledPoint> points() const;

  void clear();
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  static constexpr int block_capacity = 32;
  /// Points whose distances are computed at once.
  static constexpr int group_size = 8;
  /// Points of one voxel. Coordinates apart, by the group: few points lie in few cache lines.
  struct Block {
    struct Group {
      std::array<float, group_size> x, y, z;
    };
    int count = 0;
    int movable = 0;
    std::array<SemanticClass, block_capacity> label;
    std::array<Group, block_capacity / group_size> groups;

    [[nodiscard]] Eigen::Vector3f position(int i) const {
      const Group& group = groups[static_cast<std::size_t>(i / group_size)];
      const auto k = static_cast<std::size_t>(i % group_size);
      return {group.x[k], group.y[k], group.z[k]};
    }
    /// Asks for its first cache lines; the first groups are in five.
    void prefetch_first(std::ptrdiff_t lines) const {
      constexpr std::ptrdiff_t line_bytes = 64;
      const auto* const begin = reinterpret_cast<const std::byte*>(this);
      for (std::ptrdiff_t k = 0; k < lines; ++k) prefetch(begin + k * line_bytes);
    }
    void set_position(int i, const Eigen::Vector3f& position_map);
    /// Squared distances of a group's points; beyond `count` they mean nothing.
    [[nodiscard]] std::array<float, group_size> squared_distances(
        int first, const Eigen::Vector3f& position_map) const;
    void push(const LabelledPoint& point);
    void remove(int i);
  };
  class Nearest;

  [[nodiscard]] Eigen::Vector3i voxel_of(const Eigen::Vector3f& position_map) const;
  void insert(const LabelledPoint& point, std::uint32_t block);
  /// Position in `blocks_` of the block of a voxel of this brick, made where there is none.
  [[nodiscard]] std::uint32_t block_at(BrickIndex::Part place, std::uint32_t brick);
  [[nodiscard]] Neighbours neighbours_of(const Nearest& nearest) const;
  /// Strikes those without movable points off `movable_blocks_`.
  void keep_movable_blocks() {
    std::erase_if(movable_blocks_, [this](std::uint32_t k) { return blocks_[k].movable == 0; });
  }

  /// Voxel to its place in `blocks_`: what every look-up walks stays small.
  BrickIndex index_;
  std::vector<Block> blocks_;
  std::vector<std::uint32_t> free_blocks_;
  /// Those of `blocks_` with movable points.
  std::vector<std::uint32_t> movable_blocks_;
  std::size_t size_ = 0;
  /// Where voxels were last removed round.
  std::optional<Eigen::Vector3f> kept_round_map_;
  int max_points_;
  float voxel_size_m_;
  float min_spacing_m_;
  float radius_m_;
};

template <typename Predicate>
void FeatureMap::remove_movable_if(Predicate is_gone) {
  for (const std::uint32_t number : movable_blocks_) {
    Block& block = blocks_[number];
    for (int i = block.count - 1; i >= 0; --i) {
      if (!is_movable(block.label[static_cast<std::size_t>(i)]) || !is_gone(block.position(i)))
        continue;
      block.remove(i);
      --size_;
    }
  }
  keep_movable_blocks();
}

}  // namespace stillmap
