#include "core/odometry/features.hpp"

#include <tbb/parallel_for.h>
#include <tsl/robin_map.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>

#include "core/lidar/voxel_index.hpp"
#include "core/odometry/points_in_air.hpp"
#include "core/odometry/ring_order.hpp"
#include "core/odometry/voxel_downsample.hpp"

namespace stillmap {
namespace {

constexpr std::size_t sectors = 6;
/// A step along a ring larger than this share of the range is a jump in depth, not a surface.
constexpr float jump_share = 0.1F;
/// A picked edge covers its neighbours up to a squared step of this size [m^2] (A-LOAM).
constexpr float same_edge_step_m2 = 0.05F;

/// What is next to a point on its ring, by how far apart the ring's rays are.
struct RingSpacing {
  /// Neighbours to each side that tell how the ring bends: LOAM's five up to half a degree.
  std::size_t half_window = 5;
  /// A surface is grazed where both steps on it are longer than this share of the range, squared.
  float grazing_share2 = 0.0002F;
  /// Many single rays do not return, so that neighbours are unevenly far apart.
  bool is_uneven = false;
};

/// Whether a fifth of the steps along a ring leave out some rays: simulators drop half of them at
/// random. Real lidars lose rays one after the other, towards the sky or on dark paint, which are
/// few gaps (a VLP-16's share is 0.02 to 0.07).
bool has_many_gaps(std::span<const Eigen::Vector3f> ring, float step_rad) {
  // A longer one is no drop; one that is not round the lidar's z tells that this is no ring.
  constexpr float min_gap_steps = 1.5F, max_gap_steps = 8.0F;
  constexpr float max_rise_share = 0.3F;
  constexpr std::size_t share_of_gaps = 5;
  std::size_t gaps = 0;
  for (std::size_t i = 1; i < ring.size(); ++i) {
    const Eigen::Vector3f before = ring[i - 1].normalized(), here = ring[i].normalized();
    const float sine = before.cross(here).norm();
    const bool is_gap = sine > min_gap_steps * step_rad && sine < max_gap_steps * step_rad;
    gaps += is_gap && std::abs(here.z() - before.z()) < max_rise_share * sine ? 1 : 0;
  }
  return share_of_gaps * gaps > ring.size();
}

/// Fewer neighbours where rays are farther apart: what ten of them span is no one surface, and a
/// flat wall seen at an angle, whose points lie the farther apart the farther they are, bends as an
/// edge does. Steps that are long because the rays are far apart graze nothing, either.
RingSpacing spacing_of(std::span<const Eigen::Vector3f> ring) {
  /// Angles to the neighbours of one side, added up.
  constexpr float max_angles_rad = 0.055F;
  /// A surface at 30 degrees to the beam: its steps are so many times those of one that faces it.
  constexpr float grazing_steps = 2.0F;
  /// Up to half a degree all that is as LOAM has it, and the window up to where each point was one
  /// on a grazed surface: between both, first motions in rolling traffic have too few edges of it.
  constexpr float fine_step_rad = 0.009F;
  constexpr float fine_window_step_rad = 0.0135F;
  const float step_rad = ray_step_rad(ring);
  const auto angles_rad = [&](std::size_t neighbours) {
    return 0.5F * static_cast<float>(neighbours * (neighbours + 1)) * step_rad;
  };
  RingSpacing spacing;
  spacing.is_uneven = has_many_gaps(ring, step_rad);
  if (step_rad <= fine_step_rad) return spacing;
  while (step_rad > fine_window_step_rad && spacing.half_window > 1 &&
         angles_rad(spacing.half_window) > max_angles_rad)
    --spacing.half_window;
  const float grazing_share = grazing_steps * step_rad;
  spacing.grazing_share2 = std::max(spacing.grazing_share2, grazing_share * grazing_share);
  return spacing;
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
                      std::size_t half_window, std::vector<Use>& use) {
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
                std::size_t half_window, const FeatureConfig& config, std::vector<Use>& use) {
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
      cover_neighbours(ring, i, half_window, use);
    }
  }
}

/// Marks the far side of a jump in depth, which the near side may hide from another place, and
/// points on surfaces that the beam grazes: both change with the place of the lidar.
std::vector<bool> unreliable_points(std::span<const Eigen::Vector3f> ring,
                                    const RingSpacing& spacing) {
  const std::size_t half_window = spacing.half_window;
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
    const float grazing = spacing.grazing_share2 * ring[i].squaredNorm();
    if ((ring[i] - ring[i - 1]).squaredNorm() > grazing &&
        (ring[i + 1] - ring[i]).squaredNorm() > grazing)
      unreliable[i] = true;
  }
  return unreliable;
}

/// The part of a vector at right angles to another one.
Eigen::Vector3f across(const Eigen::Vector3f& vector, const Eigen::Vector3f& along) {
  const float length2 = along.squaredNorm();
  return length2 > 0.0F ? Eigen::Vector3f(vector - along * (along.dot(vector) / length2)) : vector;
}

/// Whether a ring goes straight on through a point, by the sums of the ways to its neighbours on
/// both sides: at the near rim of something it does not, however far off the background is.
bool is_straight(const Eigen::Vector3f& before, const Eigen::Vector3f& after) {
  constexpr float min_cosine = 0.8F;
  return -before.dot(after) > min_cosine * before.norm() * after.norm();
}

/// ring_curvature() of a ring whose spacing is known.
std::vector<float> curvature_of(std::span<const Eigen::Vector3f> ring, const RingSpacing& spacing) {
  const std::size_t half_window = spacing.half_window;
  std::vector<float> curvature(ring.size(), std::numeric_limits<float>::quiet_NaN());
  if (ring.size() <= 2 * half_window) return curvature;
  const std::vector<bool> unreliable = unreliable_points(ring, spacing);
  for (std::size_t i = half_window; i + half_window < ring.size(); ++i) {
    if (unreliable[i]) continue;
    Eigen::Vector3f before = -static_cast<float>(half_window) * ring[i];
    Eigen::Vector3f after = before;
    for (std::size_t k = 1; k <= half_window; ++k) {
      before += ring[i - k];
      after += ring[i + k];
    }
    Eigen::Vector3f sum = before + after;
    // What is left of it along a straight line is that one side's neighbours are farther away.
    if (spacing.is_uneven && is_straight(before, after)) sum = across(sum, after - before);
    curvature[i] = sum.squaredNorm();
  }
  return curvature;
}

RingFeatures features_of_ring(const Scan& scan, std::span<std::uint32_t> order,
                              const FeatureConfig& config) {
  RingFeatures features;
  if (order.empty()) return features;
  if (!runs_round(scan.points_lidar, order)) sort_by_azimuth(scan.points_lidar, order);
  std::vector<Eigen::Vector3f> ring(order.size());
  std::ranges::transform(order, ring.begin(), [&](auto i) { return scan.points_lidar[i]; });
  const RingSpacing spacing = spacing_of(ring);
  const std::vector<float> curvature = curvature_of(ring, spacing);
  std::vector<Use> use(ring.size(), Use::free);
  pick_edges(ring, curvature, spacing.half_window, config, use);
  for (std::size_t i = 0; i < ring.size(); ++i) {
    if (use[i] == Use::edge)
      features.edges.push_back(order[i]);
    else if (curvature[i] < static_cast<float>(config.plane_curvature_m2))
      features.planes.push_back(order[i]);
  }
  return features;
}

}  // namespace

std::vector<float> ring_curvature(const std::vector<Eigen::Vector3f>& ring) {
  return curvature_of(ring, spacing_of(ring));
}

std::vector<std::uint32_t> few_surfaces(const Scan& scan, const FeatureConfig& config,
                                        const Features& features) {
  const auto max_surfaces = static_cast<double>(config.max_surfaces);
  const auto count = static_cast<double>(features.surfaces.size());
  if (count <= max_surfaces) return features.surfaces;
  return voxel_downsample(scan.points_lidar, features.surfaces,
                          config.surface_spacing_m * std::sqrt(count / max_surfaces));
}

double balance_of(std::span<const Eigen::Vector3f> points_lidar,
                  std::span<const std::uint32_t> chosen) {
  constexpr std::size_t half = 18;
  std::array<bool, 2 * half> is_seen{};
  for (const std::uint32_t i : chosen) {
    const Eigen::Vector3f& p = points_lidar[i];
    const double turn = 0.5 + std::atan2(p.y(), p.x()) / (2.0 * std::numbers::pi);
    is_seen[static_cast<std::size_t>(turn * (2.0 * half)) % (2 * half)] = true;
  }
  std::size_t seen = 0;
  std::size_t opposite = 0;
  for (std::size_t k = 0; k < 2 * half; ++k) {
    seen += is_seen[k] ? 1 : 0;
    opposite += is_seen[k] && is_seen[(k + half) % (2 * half)] ? 1 : 0;
  }
  return seen == 0 ? 1.0 : static_cast<double>(opposite) / static_cast<double>(seen);
}

namespace {

/// Lidars that lean less than this are taken to stand upright: a slope of this much is level
/// ground, too [rad].
constexpr float max_lean_rad = 0.17F;
/// Those that lean more are held so. Between, the robot may be on a slope, which is its level
/// ground.
constexpr float max_slope_rad = 0.7F;

/// Where every column of the scan has points, in slices of its height.
class ColumnHeights {
 public:
  ColumnHeights(std::span<const Eigen::Vector3f> points, std::span<const std::uint32_t> chosen,
                Eigen::Matrix3f R_upright_lidar)
      : R_upright_lidar_(std::move(R_upright_lidar)) {
    slices_.reserve(chosen.size());
    for (const std::uint32_t i : chosen) {
      const Eigen::Vector3f point = R_upright_lidar_ * points[i];
      const float z = point.z();
      const auto [entry, is_new] = slices_.try_emplace(key_of(point, slice_of(z)), Range{z, z});
      if (is_new) continue;
      entry.value().low = std::min(entry->second.low, z);
      entry.value().high = std::max(entry->second.high, z);
    }
  }
  /// What the point lies on is higher than level ground. A ceiling above a floor is not.
  [[nodiscard]] bool stands_up(const Eigen::Vector3f& point_lidar) const {
    const Eigen::Vector3f point = R_upright_lidar_ * point_lidar;
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
  Eigen::Matrix3f R_upright_lidar_;
  tsl::robin_map<std::uint64_t, Range, IndexHash> slices_;
};

/// Columns along the map's z where the lidar leans; on slopes, along that of the two in which less
/// stands up.
ColumnHeights upright_columns(std::span<const Eigen::Vector3f> points,
                              std::span<const std::uint32_t> chosen,
                              const Eigen::Vector3f& up_lidar) {
  const auto own = [&] { return ColumnHeights(points, chosen, Eigen::Matrix3f::Identity()); };
  if (up_lidar.z() > std::cos(max_lean_rad)) return own();
  const auto R_upright_lidar =
      Eigen::Quaternionf::FromTwoVectors(up_lidar, Eigen::Vector3f::UnitZ()).toRotationMatrix();
  ColumnHeights by_map(points, chosen, R_upright_lidar);
  if (up_lidar.z() < std::cos(max_slope_rad)) return by_map;
  ColumnHeights by_lidar = own();
  const auto standing = [&](const ColumnHeights& columns) {
    return std::ranges::count_if(chosen,
                                 [&](std::uint32_t i) { return columns.stands_up(points[i]); });
  };
  return standing(by_map) < standing(by_lidar) ? by_map : by_lidar;
}

/// All points of the scan but those in the air, as points_in_air() has them: these are round the
/// lidar wherever it goes.
std::vector<std::uint32_t> solid_points(const Scan& scan, const std::vector<bool>& in_air) {
  std::vector<std::uint32_t> solid(scan.size());
  std::iota(solid.begin(), solid.end(), 0U);
  if (!in_air.empty()) std::erase_if(solid, [&](std::uint32_t i) { return in_air[i]; });
  return solid;
}

/// So many of them, spread evenly.
std::vector<std::uint32_t> some_of(const std::vector<std::uint32_t>& all, std::size_t max_count) {
  const std::size_t count = std::min(all.size(), max_count);
  std::vector<std::uint32_t> some(count);
  for (std::size_t k = 0; k < count; ++k) some[k] = all[k * all.size() / count];
  return some;
}

/// Spacing of the points of any kind in the local map [m].
constexpr double map_point_spacing_m = 0.5;

/// The share of all spacings that leaves enough surfaces where all is near, as in a lift, of which
/// the usual ones leave `count`: few hold no pose. 1 where these thin little more than the lidar
/// itself does. (Features of few rings do without: closer together they lie well on wrong walls.)
double spacing_share(std::size_t count, const Scan& scan) {
  constexpr double enough = 400.0;
  constexpr std::size_t min_thinning = 4;
  constexpr double min_share = 0.3;
  if (min_thinning * count > scan.size()) return 1.0;
  return std::clamp(std::sqrt(static_cast<double>(count) / enough), min_share, 1.0);
}

/// Points of any kind for the alignment of points, from those of the map's spacing, all spacings
/// times `share`.
void pick_points(const Scan& scan, std::vector<std::uint32_t> spaced, double share,
                 const Eigen::Vector3f& up_lidar, Features& features) {
  const double spacing_m = 2.0 * map_point_spacing_m * share;
  constexpr std::size_t max_upright = 800;
  constexpr std::size_t max_level = 300;
  features.points = std::move(spaced);
  features.balance = balance_of(scan.points_lidar, features.points);
  const ColumnHeights columns = upright_columns(scan.points_lidar, features.points, up_lidar);
  std::vector<std::uint32_t> upright, level;
  for (const std::uint32_t i : voxel_downsample(scan.points_lidar, features.points, spacing_m))
    (columns.stands_up(scan.points_lidar[i]) ? upright : level).push_back(i);
  features.upright_points = some_of(upright, max_upright);
  features.level_points = some_of(level, max_level);
}

}  // namespace

bool is_registered_by_surfaces(const SensorModel& sensor, const OdometryConfig& config) {
  if (sensor.pattern != ScanPattern::rings) return true;
  return !config.paper_exact && sensor.rings >= config.features.min_surface_rings;
}

bool has_sparse_rings(const SensorModel& sensor) {
  // Of 16 rings over 30 degrees, not of 32 over 41.
  constexpr double min_spacing_rad = 1.5 * std::numbers::pi / 180.0;
  return sensor.pattern == ScanPattern::rings &&
         sensor.fov_up - sensor.fov_down >= min_spacing_rad * sensor.rings;
}

Features extract_surfaces(const Scan& scan, const FeatureConfig& config,
                          const Eigen::Vector3f& up_lidar) {
  const std::vector<std::uint32_t> all = solid_points(scan, points_in_air(scan.points_lidar));
  Features features;
  const auto thin_out = [&](double share) {
    features.planes =
        voxel_downsample(scan.points_lidar, all, share * config.map_surface_spacing_m);
    features.surfaces =
        voxel_downsample(scan.points_lidar, features.planes, share * config.surface_spacing_m);
  };
  thin_out(1.0);
  const double share = spacing_share(features.surfaces.size(), scan);
  if (share < 1.0) thin_out(share);
  const ColumnHeights columns = upright_columns(scan.points_lidar, features.planes, up_lidar);
  features.is_level.resize(scan.size());
  for (const std::uint32_t i : features.surfaces)
    features.is_level[i] = !columns.stands_up(scan.points_lidar[i]);
  const bool are_points_spaced = config.surface_spacing_m == map_point_spacing_m;
  pick_points(scan,
              are_points_spaced ? features.surfaces
                                : voxel_downsample(scan.points_lidar, features.planes,
                                                   share * map_point_spacing_m),
              share, up_lidar, features);
  return features;
}

Features extract_features(const Scan& scan, const FeatureConfig& config,
                          const Eigen::Vector3f& up_lidar) {
  assert(scan.ring.size() == scan.size());
  const std::vector<bool> in_air = points_in_air(scan.points_lidar);
  RingOrder rings(scan);
  std::vector<RingFeatures> of_ring(rings.count());
  tbb::parallel_for(std::size_t{0}, rings.count(), [&](std::size_t r) {
    std::span<std::uint32_t> ring = rings.ring(r);
    // A drop between points of a surface makes edges of these.
    if (!in_air.empty()) {
      // std::ranges::remove_if is nothing for clang 14, which compiles the fuzz targets.
      const auto kept_end =
          std::remove_if(ring.begin(), ring.end(), [&](std::uint32_t i) { return in_air[i]; });
      ring = ring.first(static_cast<std::size_t>(kept_end - ring.begin()));
    }
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
  const std::vector<std::uint32_t> all = solid_points(scan, in_air);
  pick_points(scan, voxel_downsample(scan.points_lidar, all, map_point_spacing_m), 1.0, up_lidar,
              features);
  return features;
}

}  // namespace stillmap
