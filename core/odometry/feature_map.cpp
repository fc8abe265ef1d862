#include "core/odometry/feature_map.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

namespace stillmap {
namespace {

/// Steps from the voxel of a point along one axis: none, to the nearer side, to the farther one.
enum Step : std::uint8_t { here, nearer, farther };
constexpr std::size_t steps = 3;

/// The voxels round a point as they are searched, so that the search radius shrinks early: its own,
/// and the seven nearest ones, before all that need a step to the farther side.
constexpr std::size_t nearest_voxels = 8;
constexpr std::array<std::array<Step, 3>, 27> search_order = [] {
  constexpr std::array<int, steps> cost{0, 1, 9};
  std::array<std::array<Step, 3>, 27> order{};
  std::size_t n = 0;
  for (const Step x : {here, nearer, farther})
    for (const Step y : {here, nearer, farther})
      for (const Step z : {here, nearer, farther}) order[n++] = {x, y, z};
  std::ranges::sort(order, {}, [&](const std::array<Step, 3>& voxel) {
    return cost[voxel[0]] + cost[voxel[1]] + cost[voxel[2]];
  });
  return order;
}();

/// What lies along one axis: places of the three voxels, and how far the point is from them.
struct AxisSteps {
  std::array<BrickIndex::Part, steps> part;
  std::array<float, steps> squared_gap{};
  /// Whether the voxel is in another brick than the point's own one; at most one side is.
  std::array<bool, steps> in_other_brick{};
};

/// `below_m` and `above_m`: from the point to the lower and the upper face of its voxel.
template <auto part_of>
AxisSteps axis_steps(int voxel, float below_m, float above_m) {
  const int to_nearer = below_m < above_m ? -1 : 1;
  const float near_m = std::min(below_m, above_m);
  const float far_m = std::max(below_m, above_m);
  AxisSteps axis;
  axis.part = {part_of(voxel), part_of(voxel + to_nearer), part_of(voxel - to_nearer)};
  axis.squared_gap = {0.0F, near_m * near_m, far_m * far_m};
  for (const Step step : {nearer, farther})
    axis.in_other_brick[step] = axis.part[step].brick_key != axis.part[here].brick_key;
  return axis;
}

/// The voxels round a point, by their place in `search_order`.
class VoxelsAround {
 public:
  VoxelsAround(const BrickIndex& index, const Eigen::Vector3i& centre,
               const Eigen::Array3f& below_m, const Eigen::Array3f& above_m)
      : index_(index),
        x_(axis_steps<BrickIndex::part_x>(centre.x(), below_m.x(), above_m.x())),
        y_(axis_steps<BrickIndex::part_y>(centre.y(), below_m.y(), above_m.y())),
        z_(axis_steps<BrickIndex::part_z>(centre.z(), below_m.z(), above_m.z())) {
    bricks_.fill(not_looked_up);
  }

  /// From the point to the voxel.
  [[nodiscard]] float squared_gap(std::size_t v) const {
    const auto [x, y, z] = search_order[v];
    return x_.squared_gap[x] + y_.squared_gap[y] + z_.squared_gap[z];
  }
  /// To the nearest of those that need a step to the farther side.
  [[nodiscard]] float min_farther_squared_gap() const {
    return std::min({x_.squared_gap[farther], y_.squared_gap[farther], z_.squared_gap[farther]});
  }
  /// The voxel's number, or BrickIndex::none.
  [[nodiscard]] std::uint32_t number(std::size_t v) {
    const auto [x, y, z] = search_order[v];
    const auto place = BrickIndex::place(x_.part[x], y_.part[y], z_.part[z]);
    std::uint32_t& brick =
        bricks_[std::size_t{x_.in_other_brick[x]} << 2 | std::size_t{y_.in_other_brick[y]} << 1 |
                std::size_t{z_.in_other_brick[z]}];
    if (brick == not_looked_up) brick = index_.find_brick(place.brick_key);
    return brick == BrickIndex::none ? BrickIndex::none : index_.number(brick, place.cell);
  }

 private:
  static constexpr std::uint32_t not_looked_up = BrickIndex::none - 1;
  const BrickIndex& index_;
  AxisSteps x_, y_, z_;
  /// Of the point's own brick and those beside it.
  std::array<std::uint32_t, 8> bricks_;
};

}  // namespace

/// The n nearest points so far, nearest first, in words that sort as distances do.
class FeatureMap::Nearest {
 public:
  explicit Nearest(int n) : n_(n) {}

  /// Returns whether there are n.
  bool add(float squared_distance, std::uint32_t block, int i) {
    const std::uint64_t word =
        std::uint64_t{std::bit_cast<std::uint32_t>(squared_distance)} << 32 |
        (block * std::uint32_t{block_capacity} + static_cast<std::uint32_t>(i));
    int place = count_ < n_ ? count_++ : n_ - 1;
    for (; place > 0 && at(place - 1) > word; --place) at(place) = at(place - 1);
    at(place) = word;
    return count_ == n_;
  }
  [[nodiscard]] int count() const { return count_; }
  [[nodiscard]] float squared_distance(int k) const {
    return std::bit_cast<float>(static_cast<std::uint32_t>(at(k) >> 32));
  }
  [[nodiscard]] std::uint32_t block(int k) const {
    return static_cast<std::uint32_t>(at(k)) / block_capacity;
  }
  [[nodiscard]] int index_in_block(int k) const {
    return static_cast<int>(static_cast<std::uint32_t>(at(k)) % block_capacity);
  }

 private:
  [[nodiscard]] std::uint64_t& at(int k) { return words_[static_cast<std::size_t>(k)]; }
  [[nodiscard]] std::uint64_t at(int k) const { return words_[static_cast<std::size_t>(k)]; }

  int n_;
  int count_ = 0;
  std::array<std::uint64_t, Neighbours::capacity> words_;
};

void FeatureMap::Block::set_position(int i, const Eigen::Vector3f& position_map) {
  Group& group = groups[static_cast<std::size_t>(i / group_size)];
  const auto k = static_cast<std::size_t>(i % group_size);
  group.x[k] = position_map.x();
  group.y[k] = position_map.y();
  group.z[k] = position_map.z();
}

std::array<float, FeatureMap::group_size> FeatureMap::Block::squared_distances(
    int first, const Eigen::Vector3f& position_map) const {
  const Group& group = groups[static_cast<std::size_t>(first / group_size)];
  std::array<float, group_size> squared;
  for (std::size_t k = 0; k < group_size; ++k) {
    const float dx = group.x[k] - position_map.x();
    const float dy = group.y[k] - position_map.y();
    const float dz = group.z[k] - position_map.z();
    squared[k] = dx * dx + dy * dy + dz * dz;
  }
  return squared;
}

void FeatureMap::Block::push(const LabelledPoint& point) {
  label[static_cast<std::size_t>(count)] = point.label;
  set_position(count++, point.position_map);
  movable += is_movable(point.label) ? 1 : 0;
}

void FeatureMap::Block::remove(int i) {
  const auto k = static_cast<std::size_t>(i);
  movable -= is_movable(label[k]) ? 1 : 0;
  label[k] = label[static_cast<std::size_t>(--count)];
  set_position(i, position(count));
}

FeatureMap::FeatureMap(const LocalMapConfig& config)
    : max_points_(std::min(config.max_points_per_voxel, block_capacity)),
      voxel_size_m_(static_cast<float>(config.voxel_size_m)),
      min_spacing_m_(static_cast<float>(config.min_spacing_m)),
      radius_m_(static_cast<float>(config.radius_m)) {}

Eigen::Vector3i FeatureMap::voxel_of(const Eigen::Vector3f& position_map) const {
  // Places that are not finite or out of the index's reach come to lie at its ends.
  static constexpr float reach = 1U << 20U;
  const auto clamped = [](float voxel) {
    return static_cast<int>(voxel > -reach ? std::min(voxel, reach) : -reach);
  };
  return (position_map / voxel_size_m_).array().floor().unaryExpr(clamped);
}

void FeatureMap::insert(std::span<const LabelledPoint> points) {
  // So many blocks are on their way at once.
  constexpr std::size_t ahead = 32;
  std::array<std::uint32_t, ahead> blocks;
  // Points that were measured one after the other mostly share a brick.
  std::optional<std::uint64_t> brick_key;
  std::uint32_t brick = BrickIndex::none;
  for (std::size_t begin = 0; begin < points.size(); begin += ahead) {
    const auto some = points.subspan(begin, std::min(ahead, points.size() - begin));
    for (std::size_t i = 0; i < some.size(); ++i) {
      const Eigen::Vector3i voxel = voxel_of(some[i].position_map);
      const auto place = BrickIndex::place(voxel.x(), voxel.y(), voxel.z());
      if (brick_key != place.brick_key) {
        brick_key = place.brick_key;
        brick = index_.brick_at(place.brick_key);
      }
      blocks[i] = block_at(place, brick);
      blocks_[blocks[i]].prefetch_first(5);
    }
    for (std::size_t i = 0; i < some.size(); ++i) insert(some[i], blocks[i]);
  }
}

std::uint32_t FeatureMap::block_at(BrickIndex::Part place, std::uint32_t brick) {
  std::uint32_t& number = index_.number(brick, place.cell);
  if (number != BrickIndex::none) return number;
  if (free_blocks_.empty()) {
    free_blocks_.push_back(static_cast<std::uint32_t>(blocks_.size()));
    blocks_.emplace_back();
  }
  number = free_blocks_.back();
  free_blocks_.pop_back();
  return number;
}

void FeatureMap::prefetch_near(const Eigen::Vector3f& position_map) const {
  const Eigen::Vector3i voxel = voxel_of(position_map);
  const std::uint32_t number = index_.number(BrickIndex::place(voxel.x(), voxel.y(), voxel.z()));
  if (number != BrickIndex::none) blocks_[number].prefetch_first(5);
}

void FeatureMap::insert(const LabelledPoint& point, std::uint32_t block_number) {
  Block& block = blocks_[block_number];
  if (block.count >= max_points_) return;
  const float min_squared = min_spacing_m_ * min_spacing_m_;
  for (int first = 0; first < block.count; first += group_size) {
    const auto squared = block.squared_distances(first, point.position_map);
    const int count = std::min(group_size, block.count - first);
    for (int k = 0; k < count; ++k)
      if (squared[static_cast<std::size_t>(k)] < min_squared) return;
  }
  block.push(point);
  ++size_;
  if (block.movable == 1 && is_movable(point.label)) movable_blocks_.push_back(block_number);
}

Neighbours FeatureMap::nearest(const Eigen::Vector3f& position_map, int n,
                               float max_distance_m) const {
  assert(n >= 1 && n <= Neighbours::capacity && max_distance_m <= voxel_size_m_ * 1.0001F);
  const Eigen::Vector3i centre = voxel_of(position_map);
  // Distance from the point to the voxel's lower and upper faces.
  const Eigen::Array3f below = position_map.array() - centre.cast<float>().array() * voxel_size_m_;
  const Eigen::Array3f above = voxel_size_m_ - below;
  VoxelsAround voxels(index_, centre, below, above);
  // Voxels this near are usually looked through: their memory is on its way meanwhile.
  const float usual_squared = 0.1F * voxel_size_m_ * voxel_size_m_;
  for (std::size_t v = 1; v < nearest_voxels; ++v) {
    if (voxels.squared_gap(v) > usual_squared) continue;
    const std::uint32_t number = voxels.number(v);
    if (number != BrickIndex::none) blocks_[number].prefetch_first(2);
  }
  Nearest found(n);
  float limit = max_distance_m * max_distance_m;
  for (std::size_t v = 0; v < search_order.size(); ++v) {
    if (v == nearest_voxels && voxels.min_farther_squared_gap() > limit) break;
    if (voxels.squared_gap(v) > limit) continue;
    const std::uint32_t number = voxels.number(v);
    if (number == BrickIndex::none) continue;
    const Block& block = blocks_[number];
    for (int first = 0; first < block.count; first += group_size) {
      const auto squared = block.squared_distances(first, position_map);
      const int count = std::min(group_size, block.count - first);
      for (int k = 0; k < count; ++k) {
        const float distance = squared[static_cast<std::size_t>(k)];
        if (distance <= limit && found.add(distance, number, first + k))
          limit = found.squared_distance(n - 1);
      }
    }
  }
  return neighbours_of(found);
}

Neighbours FeatureMap::neighbours_of(const Nearest& nearest) const {
  Neighbours neighbours;
  neighbours.count = nearest.count();
  for (int k = 0; k < nearest.count(); ++k) {
    const Block& block = blocks_[nearest.block(k)];
    const int i = nearest.index_in_block(k);
    neighbours.squared_distance[static_cast<std::size_t>(k)] = nearest.squared_distance(k);
    neighbours.points[static_cast<std::size_t>(k)] = {block.position(i),
                                                      block.label[static_cast<std::size_t>(i)]};
  }
  return neighbours;
}

void FeatureMap::remove_far_from(const Eigen::Vector3f& centre_map) {
  if (kept_round_map_ && (centre_map - *kept_round_map_).norm() < 0.02F * radius_m_) return;
  kept_round_map_ = centre_map;
  // What lies well within the radius stays without being looked at.
  constexpr float brick_diagonal_voxels = 6.0F;
  const float inner_radius_m = radius_m_ - brick_diagonal_voxels * voxel_size_m_;
  const auto is_near_the_edge = [&](int x, int y, int z) {
    const Eigen::Vector3f corner_map = voxel_size_m_ * Eigen::Vector3i(x, y, z).cast<float>();
    return !((corner_map - centre_map).norm() < inner_radius_m);
  };
  index_.erase_if(is_near_the_edge, [&](std::uint32_t number) {
    Block& block = blocks_[number];
    if (block.count > 0 && (block.position(0) - centre_map).squaredNorm() <= radius_m_ * radius_m_)
      return false;
    size_ -= static_cast<std::size_t>(block.count);
    block = Block{};
    free_blocks_.push_back(number);
    return true;
  });
  keep_movable_blocks();
}

std::vector<LabelledPoint> FeatureMap::points() const {
  std::vector<LabelledPoint> all;
  all.reserve(size_);
  for (const Block& block : blocks_)
    for (int i = 0; i < block.count; ++i)
      all.push_back({block.position(i), block.label[static_cast<std::size_t>(i)]});
  return all;
}

void FeatureMap::clear() {
  index_.clear();
  blocks_.clear();
  free_blocks_.clear();
  movable_blocks_.clear();
  size_ = 0;
  kept_round_map_.reset();
}

}  // namespace stillmap
