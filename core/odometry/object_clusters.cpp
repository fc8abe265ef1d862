#include "core/odometry/object_clusters.hpp"

#include <tsl/robin_map.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numeric>
#include <optional>

#include "core/lidar/voxel_index.hpp"

namespace stillmap {
namespace {

/// 0 vehicle, 1 person, 2 two-wheeler or its rider.
std::uint64_t kind_of(SemanticClass label) {
  switch (label) {
    case SemanticClass::person:
      return 1;
    case SemanticClass::bicycle:
    case SemanticClass::motorcycle:
    case SemanticClass::bicyclist:
    case SemanticClass::motorcyclist:
      return 2;
    default:
      return 0;
  }
}

struct Cube {
  Eigen::Vector3i index;
  std::uint64_t kind;
  /// Lowest and highest of its points [m].
  float low_m;
  float high_m;
  std::uint32_t points = 0;
  std::uint32_t cars = 0;
};

std::uint64_t key_of(const Eigen::Vector3i& index, std::uint64_t kind) {
  constexpr std::uint64_t mask = (1U << 20) - 1;
  const auto part = [](int v) { return static_cast<std::uint64_t>(v) & mask; };
  return kind << 60 | part(index.x()) << 40 | part(index.y()) << 20 | part(index.z());
}

/// Disjoint sets of cubes.
class Sets {
 public:
  explicit Sets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }
  [[nodiscard]] std::uint32_t root(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) { parent_[root(b)] = root(a); }

 private:
  std::vector<std::uint32_t> parent_;
};

using CubeTable = tsl::robin_map<std::uint64_t, std::uint32_t, IndexHash>;

void join_neighbours(const std::vector<Cube>& cubes, const CubeTable& table, Sets& sets) {
  for (std::uint32_t c = 0; c < cubes.size(); ++c) {
    // Half of the 26 neighbours: the other half finds this cube.
    for (int n = 14; n < 27; ++n) {
      const Eigen::Vector3i step(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
      const auto neighbour = table.find(key_of(cubes[c].index + step, cubes[c].kind));
      if (neighbour != table.end()) sets.join(c, neighbour->second);
    }
  }
}

/// What the cubes of an object make together.
struct Shape {
  Eigen::AlignedBox3f box;
  std::uint32_t points = 0;
  std::uint32_t cars = 0;

  void add(const Cube& cube, float gap_m) {
    const Eigen::Vector3f corner = cube.index.cast<float>() * gap_m;
    box.extend(Eigen::Vector3f(corner.x(), corner.y(), cube.low_m));
    box.extend(Eigen::Vector3f(corner.x() + gap_m, corner.y() + gap_m, cube.high_m));
    points += cube.points;
    cars += cube.cars;
  }
};

/// Objects in the order of their first cubes, which is that of their first points.
std::vector<std::int32_t> number_objects(const std::vector<Cube>& cubes, float gap_m, Sets& sets,
                                         ObjectClusters& objects) {
  std::vector<std::int32_t> object_of_root(cubes.size(), ObjectClusters::none);
  std::vector<std::int32_t> object_of_cube(cubes.size());
  std::vector<Shape> shapes;
  for (std::size_t c = 0; c < cubes.size(); ++c) {
    std::int32_t& number = object_of_root[sets.root(static_cast<std::uint32_t>(c))];
    if (number == ObjectClusters::none) {
      number = static_cast<std::int32_t>(shapes.size());
      shapes.emplace_back();
    }
    object_of_cube[c] = number;
    shapes[static_cast<std::size_t>(number)].add(cubes[c], gap_m);
  }
  objects.count = shapes.size();
  for (const Shape& shape : shapes) {
    const Eigen::Vector3f sizes_m = shape.box.sizes();
    objects.height_m.push_back(sizes_m.z());
    objects.length_m.push_back(sizes_m.head<2>().norm());
    objects.is_car.push_back(2 * shape.cars > shape.points);
  }
  return object_of_cube;
}

}  // namespace

ObjectClusters cluster_objects(std::span<const Eigen::Vector3f> points_lidar,
                               std::span<const SemanticClass> labels, double gap_m) {
  ObjectClusters objects{std::vector<std::int32_t>(points_lidar.size(), ObjectClusters::none), 0};
  if (labels.empty()) return objects;
  const auto inverse_gap = static_cast<float>(1.0 / gap_m);
  CubeTable table;
  std::vector<Cube> cubes;
  std::optional<std::uint64_t> last_key;
  std::int32_t last_cube = ObjectClusters::none;
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    if (!is_movable(labels[i])) continue;
    const float z_m = points_lidar[i].z();
    const Cube cube{(points_lidar[i] * inverse_gap).array().floor().cast<int>(), kind_of(labels[i]),
                    z_m, z_m};
    const std::uint64_t key = key_of(cube.index, cube.kind);
    // Points that were measured one after the other mostly share a cube.
    if (key != last_key) {
      const auto [entry, is_new] = table.try_emplace(key, static_cast<std::uint32_t>(cubes.size()));
      if (is_new) cubes.push_back(cube);
      last_key = key;
      last_cube = static_cast<std::int32_t>(entry->second);
    }
    Cube& own = cubes[static_cast<std::size_t>(last_cube)];
    own.low_m = std::min(own.low_m, z_m);
    own.high_m = std::max(own.high_m, z_m);
    ++own.points;
    own.cars += labels[i] == SemanticClass::car ? 1 : 0;
    objects.of_point[i] = last_cube;
    objects.movable_points.push_back(static_cast<std::uint32_t>(i));
  }
  Sets sets(cubes.size());
  join_neighbours(cubes, table, sets);
  const std::vector<std::int32_t> object_of_cube =
      number_objects(cubes, static_cast<float>(gap_m), sets, objects);
  for (const std::uint32_t i : objects.movable_points) {
    std::int32_t& of_point = objects.of_point[i];
    of_point = object_of_cube[static_cast<std::size_t>(of_point)];
  }
  return objects;
}

}  // namespace stillmap
