#include "core/odometry/features.hpp"

#include <tbb/parallel_for.h>
#include <tsl/robin_map.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "core/lidar/voxel_index.hpp"

namespace stillmap {
namespace {

constexpr std::size_t half_window = 5;
constexpr std::size_t sectors = 6;
/// A step along a ring larger than this share of the range is a jump in depth, not a surface.
constexpr float jump_share = 0.1F;
/// A picked edge covers its neighbours up to a squared step of this size [m^2] (A-LOAM).
constexpr float same_edge_step_m2 = 0.05F;

/// Points of the scan by ring: ring r is order[begin[r] .. begin[r + 1]), in firing order.
struct RingOrder {
  std::vector<std::uint32_t> order;
  std::vector<std::uint32_t> begin;
};

RingOrder order_by_ring(const Scan& scan) {
  const std::size_t rings =
      scan.empty() ? 0 : std::size_t{*std::ranges::max_element(scan.ring)} + 1;
  RingOrder rings_of{std::vector<std::uint32_t>(scan.size()),
                     std::vector<std::uint32_t>(rings + 1, 0)};
  for (const std::uint16_t ring : scan.ring) ++rings_of.begin[ring + 1U];
  std::partial_sum(rings_of.begin.begin(), rings_of.begin.end(), rings_of.begin.begin());
  std::vector<std::uint32_t> next(rings_of.begin.begin(), rings_of.begin.end());
  for (std::uint32_t i = 0; i < scan.size(); ++i) rings_of.order[next[scan.ring[i]]++] = i;
  return rings_of;
}

/// Whether the azimuth runs one way along the ring, but for the noise of motion compensation.
bool runs_round(const std::vector<Eigen::Vector3f>& points, std::span<const std::uint32_t> ring) {
  std::size_t forwards = 0;
  std::size_t backwards = 0;
  for (std::size_t i = 1; i < ring.size(); ++i) {
    const Eigen::Vector3f& a = points[ring[i - 1]];
    const Eigen::Vector3f& b = points[ring[i]];
    (a.x() * b.y() - a.y() * b.x() >= 0.0F ? forwards : backwards) += 1;
  }
  return std::min(forwards, backwards) * 10 <= ring.size();
}

void sort_by_azimuth(const std::vector<Eigen::Vector3f>& points, std::span<std::uint32_t> ring) {
  std::ranges::stable_sort(
      ring, {}, [&](std::uint32_t i) { return std::atan2(points[i].y(), points[i].x()); });
}

enum class Use : std::uint8_t { free, taken, edge };

/// Keeps neighbours of a picked edge on the same surface from being picked too.
void cover_neighbours(std::span<const Eigen::Vector3f> ring, std::size_t picked,
                      std::vector<Use>& use) {
  for (const int direction : {-1, 1}) {
    std::size_t i = picked;
    for (std::size_t step = 0; step < half_window; ++step) {
      if (direction < 0 ? i == 0 : i + 1 >= ring.size()) break;
      const std::size_t next = direction < 0 ? i - 1 : i + 1;
      if ((ring[next] - ring[i]).squaredNorm() > same_edge_step_m2) break;
      if (use[next] == Use::free) use[next] = Use::taken;
      i = next;
    }
  }
}

struct RingFeatures {
  std::vector<std::uint32_t> edges;
  std::vector<std::uint32_t> planes;
};

void pick_edges(std::span<const Eigen::Vector3f> ring, std::span<const float> curvature,
                const FeatureConfig& config, std::vector<Use>& use) {
  std::vector<std::uint32_t> sharp;
  for (std::size_t sector = 0; sector < sectors; ++sector) {
    const std::size_t first = ring.size() * sector / sectors;
    const std::size_t last = ring.size() * (sector + 1) / sectors;
    sharp.clear();
    for (std::size_t i = first; i < last; ++i)
      if (curvature[i] > static_cast<float>(config.edge_curvature_m2))
        sharp.push_back(static_cast<std::uint32_t>(i));
    std::ranges::sort(sharp, [&](std::uint32_t a, std::uint32_t b) {
      return curvature[a] != curvature[b] ? curvature[a] > curvature[b] : a < b;
    });
    int picked = 0;
    for (const std::uint32_t i : sharp) {
      if (picked == config.edges_per_sector) break;
      if (use[i] != Use::free) continue;
      use[i] = Use::edge;
      ++picked;
      cover_neighbours(ring, i, use);
    }
  }
}

RingFeatures features_of_ring(const Scan& scan, std::span<std::uint32_t> order,
                              const FeatureConfig& config) {
  RingFeatures features;
  if (order.size() <= 2 * half_window) return features;
  if (!runs_round(scan.points_lidar, order)) sort_by_azimuth(scan.points_lidar, order);
  std::vector<Eigen::Vector3f> ring(order.size());
  std::ranges::transform(order, ring.begin(), [&](auto i) { return scan.points_lidar[i]; });
  const std::vector<float> curvature = ring_curvature(ring);
  std::vector<Use> use(ring.size(), Use::free);
  pick_edges(ring, curvature, config, use);
  for (std::size_t i = 0; i < ring.size(); ++i) {
    if (use[i] == Use::edge)
      features.edges.push_back(order[i]);
    else if (curvature[i] < static_cast<float>(config.plane_curvature_m2))
      features.planes.push_back(order[i]);
  }
  return features;
}

/// Marks the far side of a jump in depth, which the near side may hide from another place, and
/// points on surfaces that the beam grazes: both change with the place of the lidar.
std::vector<bool> unreliable_points(std::span<const Eigen::Vector3f> ring) {
  std::vector<bool> unreliable(ring.size(), false);
  for (std::size_t i = 0; i + 1 < ring.size(); ++i) {
    const float range = ring[i].norm();
    const float next_range = ring[i + 1].norm();
    const float jump = jump_share * std::min(range, next_range);
    if (std::abs(range - next_range) <= jump) continue;
    const bool next_is_far = next_range > range;
    const std::size_t first = next_is_far ? i + 1 : (i >= half_window ? i - half_window : 0);
    const std::size_t last = next_is_far ? std::min(i + half_window + 1, ring.size() - 1) : i;
    for (std::size_t k = first; k <= last; ++k) unreliable[k] = true;
  }
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) {
    const float grazing = 0.0002F * ring[i].squaredNorm();
    if ((ring[i] - ring[i - 1]).squaredNorm() > grazing &&
        (ring[i + 1] - ring[i]).squaredNorm() > grazing)
      unreliable[i] = true;
  }
  return unreliable;
}

/// Cubes of space that are taken, 64 to a brick of 4 x 4 x 4: points that were measured one after
/// the other mostly share a brick, and no look-up is needed for them.
class TakenCubes {
 public:
  TakenCubes() : slots_(initial_slots) {}

  /// Whether it was free until now.
  bool take(int x, int y, int z) {
    const std::uint64_t brick = packed_index(x >> 2, y >> 2, z >> 2);
    if (brick != brick_) go_to(brick);
    const int place = (x & 3) << 4 | (y & 3) << 2 | (z & 3);
    const std::uint64_t bit = std::uint64_t{1} << place;
    const bool was_free = (taken_ & bit) == 0;
    taken_ |= bit;
    return was_free;
  }

 private:
  static constexpr std::size_t initial_slots = 2048;
  static constexpr std::uint64_t unused = ~std::uint64_t{0};
  struct Slot {
    std::uint64_t brick = unused;
    std::uint64_t taken = 0;
  };

  [[nodiscard]] std::size_t slot_of(std::uint64_t brick) const {
    std::size_t slot = IndexHash{}(brick) & (slots_.size() - 1);
    while (slots_[slot].brick != unused && slots_[slot].brick != brick)
      slot = (slot + 1) & (slots_.size() - 1);
    return slot;
  }
  void go_to(std::uint64_t brick) {
    if (brick_ != unused) slots_[slot_].taken = taken_;
    brick_ = brick;
    slot_ = slot_of(brick);
    taken_ = slots_[slot_].taken;
    if (slots_[slot_].brick == brick) return;
    slots_[slot_].brick = brick;
    if (2 * ++bricks_ > slots_.size()) grow();
  }
  void grow() {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    for (const Slot& slot : old)
      if (slot.brick != unused) slots_[slot_of(slot.brick)] = slot;
    slot_ = slot_of(brick_);
  }

  std::vector<Slot> slots_;
  std::size_t bricks_ = 0;
  /// The last brick: what is taken of it, and where that belongs.
  std::uint64_t brick_ = unused;
  std::uint64_t taken_ = 0;
  std::size_t slot_ = 0;
};

}  // namespace

std::vector<float> ring_curvature(const std::vector<Eigen::Vector3f>& ring) {
  std::vector<float> curvature(ring.size(), std::numeric_limits<float>::quiet_NaN());
  if (ring.size() <= 2 * half_window) return curvature;
  const std::vector<bool> unreliable = unreliable_points(ring);
  for (std::size_t i = half_window; i + half_window < ring.size(); ++i) {
    if (unreliable[i]) continue;
    Eigen::Vector3f sum = -static_cast<float>(2 * half_window) * ring[i];
    for (std::size_t k = 1; k <= half_window; ++k) sum += ring[i - k] + ring[i + k];
    curvature[i] = sum.squaredNorm();
  }
  return curvature;
}

namespace {

/// Numbers 0 to n - 1, each once, in steps of the golden section.
class ScatteredOrder {
 public:
  explicit ScatteredOrder(std::size_t n)
      : size_(n), step_(static_cast<std::size_t>(0.618034 * static_cast<double>(n))), next_(n / 2) {
    while (std::gcd(step_, size_) > 1) ++step_;
  }
  std::size_t next() {
    const std::size_t here = next_;
    next_ += step_;
    if (next_ >= size_) next_ -= size_;
    return here;
  }

 private:
  std::size_t size_;
  std::size_t step_;
  std::size_t next_;
};

/// The same of many things, by windows of neighbours, which stay in the processor's cache.
class ScatteredWindows {
 public:
  explicit ScatteredWindows(std::size_t n)
      : size_(n), windows_((n + window_size - 1) / window_size), in_window_(0) {}
  std::size_t next() {
    if (left_ == 0) {
      first_ = windows_.next() * window_size;
      left_ = std::min(window_size, size_ - first_);
      in_window_ = ScatteredOrder(left_);
    }
    --left_;
    return first_ + in_window_.next();
  }

 private:
  static constexpr std::size_t window_size = 128;
  std::size_t size_;
  std::size_t first_ = 0;
  std::size_t left_ = 0;
  ScatteredOrder windows_;
  ScatteredOrder in_window_;
};

/// The one of each cube that is visited first. In the order of the scan that is the one on the side
/// that the lidar looks at first: of such points every scan turned the lidar a little, always the
/// way that it turns itself.
std::vector<std::uint32_t> one_of_each_cube(std::span<const Eigen::Vector3f> points,
                                            std::span<const std::uint32_t> chosen,
                                            float inverse_spacing) {
  // So many cubes are worked out at once, in vector registers.
  constexpr std::size_t block_size = 16;
  using Block = Eigen::Array<float, block_size, 1>;
  using Cubes = Eigen::Array<int, block_size, 1>;
  TakenCubes taken;
  ScatteredWindows order(chosen.size());
  std::vector<std::uint32_t> kept(chosen.size());
  std::size_t count = 0;
  Block x = Block::Zero(), y = Block::Zero(), z = Block::Zero();
  for (std::size_t begin = 0; begin < chosen.size(); begin += block_size) {
    std::array<std::uint32_t, block_size> some;
    const std::size_t size = std::min(block_size, chosen.size() - begin);
    for (std::size_t k = 0; k < size; ++k) some[k] = chosen[order.next()];
    for (std::size_t k = 0; k < size; ++k) {
      const auto lane = static_cast<Eigen::Index>(k);
      const Eigen::Vector3f& p = points[some[k]];
      x[lane] = p.x();
      y[lane] = p.y();
      z[lane] = p.z();
    }
    const Cubes cube_x = (x * inverse_spacing).floor().cast<int>();
    const Cubes cube_y = (y * inverse_spacing).floor().cast<int>();
    const Cubes cube_z = (z * inverse_spacing).floor().cast<int>();
    for (std::size_t k = 0; k < size; ++k) {
      const auto lane = static_cast<Eigen::Index>(k);
      kept[count] = some[k];
      count += taken.take(cube_x[lane], cube_y[lane], cube_z[lane]) ? 1 : 0;
    }
  }
  kept.resize(count);
  return kept;
}

}  // namespace

std::vector<std::uint32_t> voxel_downsample(std::span<const Eigen::Vector3f> points,
                                            std::span<const std::uint32_t> chosen,
                                            double spacing_m) {
  constexpr std::size_t block_size = 16384;
  const auto inverse_spacing = static_cast<float>(1.0 / spacing_m);
  const std::size_t blocks = chosen.size() / block_size + 1;
  if (blocks == 1) return one_of_each_cube(points, chosen, inverse_spacing);
  std::vector<std::vector<std::uint32_t>> of_block(blocks);
  tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t k) {
    const std::size_t begin = k * block_size;
    const auto block = chosen.subspan(begin, std::min(block_size, chosen.size() - begin));
    of_block[k] = one_of_each_cube(points, block, inverse_spacing);
  });
  std::vector<std::uint32_t> candidates;
  for (const auto& block : of_block)
    candidates.insert(candidates.end(), block.begin(), block.end());
  return one_of_each_cube(points, candidates, inverse_spacing);
}

std::vector<std::uint32_t> few_surfaces(const Scan& scan, const FeatureConfig& config,
                                        const Features& features) {
  const auto max_surfaces = static_cast<double>(config.max_surfaces);
  const auto count = static_cast<double>(features.surfaces.size());
  if (count <= max_surfaces) return features.surfaces;
  return voxel_downsample(scan.points_lidar, features.surfaces,
                          config.surface_spacing_m * std::sqrt(count / max_surfaces));
}

namespace {

/// Where every column of the scan has points, in slices of its height.
class ColumnHeights {
 public:
  ColumnHeights(std::span<const Eigen::Vector3f> points, std::span<const std::uint32_t> chosen) {
    slices_.reserve(chosen.size());
    for (const std::uint32_t i : chosen) {
      const float z = points[i].z();
      const auto [entry, is_new] = slices_.try_emplace(key_of(points[i], slice_of(z)), Range{z, z});
      if (is_new) continue;
      entry.value().low = std::min(entry->second.low, z);
      entry.value().high = std::max(entry->second.high, z);
    }
  }
  /// What the point lies on is higher than level ground. A ceiling above a floor is not.
  [[nodiscard]] bool stands_up(const Eigen::Vector3f& point) const {
    constexpr float min_height_m = 0.6F;
    // So far above and below the next rings of a sparse lidar meet a wall.
    constexpr float min_reach_m = 1.25F;
    constexpr float ring_step_rad = 0.045F;
    const float reach_m = std::max(min_reach_m, ring_step_rad * point.head<2>().norm());
    Range range{point.z(), point.z()};
    const int last = slice_of(point.z() + reach_m);
    for (int slice = slice_of(point.z() - reach_m); slice <= last; ++slice) {
      const auto entry = slices_.find(key_of(point, slice));
      if (entry == slices_.end()) continue;
      range.low = std::min(range.low, entry->second.low);
      range.high = std::max(range.high, entry->second.high);
      if (range.high - range.low > min_height_m) return true;
    }
    return false;
  }

 private:
  struct Range {
    float low;
    float high;
  };
  static int slice_of(float z) {
    constexpr float slice_m = 0.5F;
    return static_cast<int>(std::floor(z / slice_m));
  }
  static std::uint64_t key_of(const Eigen::Vector3f& point, int slice) {
    // Columns of 1 m.
    return packed_index(static_cast<int>(std::floor(point.x())),
                        static_cast<int>(std::floor(point.y())), slice);
  }
  tsl::robin_map<std::uint64_t, Range, IndexHash> slices_;
};

/// So many of them, spread evenly.
std::vector<std::uint32_t> some_of(const std::vector<std::uint32_t>& all, std::size_t max_count) {
  const std::size_t count = std::min(all.size(), max_count);
  std::vector<std::uint32_t> some(count);
  for (std::size_t k = 0; k < count; ++k) some[k] = all[k * all.size() / count];
  return some;
}

/// Spacing of the points of any kind in the local map [m].
constexpr double map_point_spacing_m = 0.5;

/// Points of any kind for the alignment of points, from those of the map's spacing.
void pick_points(const Scan& scan, std::vector<std::uint32_t> spaced, Features& features) {
  constexpr double spacing_m = 1.0;
  constexpr std::size_t max_upright = 800;
  constexpr std::size_t max_level = 300;
  features.points = std::move(spaced);
  const ColumnHeights columns(scan.points_lidar, features.points);
  std::vector<std::uint32_t> upright, level;
  for (const std::uint32_t i : voxel_downsample(scan.points_lidar, features.points, spacing_m))
    (columns.stands_up(scan.points_lidar[i]) ? upright : level).push_back(i);
  features.upright_points = some_of(upright, max_upright);
  features.level_points = some_of(level, max_level);
}

}  // namespace

bool is_registered_by_surfaces(const SensorModel& sensor, const OdometryConfig& config) {
  if (sensor.pattern == ScanPattern::irregular) return true;
  return !config.paper_exact && sensor.rings >= config.features.min_surface_rings;
}

bool has_sparse_rings(const SensorModel& sensor) {
  // Of 16 rings over 30 degrees, not of 32 over 41.
  constexpr double min_spacing_rad = 1.5 * std::numbers::pi / 180.0;
  return sensor.pattern != ScanPattern::irregular &&
         sensor.fov_up - sensor.fov_down >= min_spacing_rad * sensor.rings;
}

Features extract_surfaces(const Scan& scan, const FeatureConfig& config) {
  std::vector<std::uint32_t> all(scan.size());
  std::iota(all.begin(), all.end(), 0U);
  Features features;
  features.planes = voxel_downsample(scan.points_lidar, all, config.map_surface_spacing_m);
  features.surfaces =
      voxel_downsample(scan.points_lidar, features.planes, config.surface_spacing_m);
  const bool are_points_spaced = config.surface_spacing_m == map_point_spacing_m;
  pick_points(scan,
              are_points_spaced
                  ? features.surfaces
                  : voxel_downsample(scan.points_lidar, features.planes, map_point_spacing_m),
              features);
  return features;
}

Features extract_features(const Scan& scan, const FeatureConfig& config) {
  assert(scan.ring.size() == scan.size());
  RingOrder rings = order_by_ring(scan);
  const std::size_t ring_count = rings.begin.size() - 1;
  std::vector<RingFeatures> of_ring(ring_count);
  tbb::parallel_for(std::size_t{0}, ring_count, [&](std::size_t r) {
    const std::span ring(rings.order.begin() + rings.begin[r],
                         rings.order.begin() + rings.begin[r + 1]);
    of_ring[r] = features_of_ring(scan, ring, config);
  });
  std::vector<std::uint32_t> edges;
  std::vector<std::uint32_t> planes;
  for (const RingFeatures& ring : of_ring) {
    edges.insert(edges.end(), ring.edges.begin(), ring.edges.end());
    planes.insert(planes.end(), ring.planes.begin(), ring.planes.end());
  }
  Features features;
  features.edges = voxel_downsample(scan.points_lidar, edges, config.edge_spacing_m);
  features.planes = voxel_downsample(scan.points_lidar, planes, config.map_plane_spacing_m);
  features.registered_planes =
      voxel_downsample(scan.points_lidar, features.planes, config.plane_spacing_m);
  std::vector<std::uint32_t> all(scan.size());
  std::iota(all.begin(), all.end(), 0U);
  pick_points(scan, voxel_downsample(scan.points_lidar, all, map_point_spacing_m), features);
  return features;
}

}  // namespace stillmap
