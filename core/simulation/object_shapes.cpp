#include "core/simulation/object_shapes.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace stillmap::simulation {
namespace {

ObjectShape measured(ObjectKind kind, Mesh mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  // Twice the longer half, since shapes need not be centred exactly.
  const float length = 2.0F * std::max(box.max().x(), -box.min().x());
  const float width = 2.0F * std::max(box.max().y(), -box.min().y());
  return {kind, length, width, std::move(mesh)};
}

Mesh mesh_of(ObjectKind kind, Variety variety, Random& random) {
  switch (kind) {
    case ObjectKind::car:
    case ObjectKind::truck:
    case ObjectKind::bus:
    case ObjectKind::other_vehicle:
      return make_vehicle(kind, variety, random);
    default:
      return make_person_or_two_wheeler(kind, random);
  }
}

}  // namespace

std::uint16_t standing_label(ObjectKind kind) {
  constexpr std::array<std::uint16_t, 9> ids{10, 18, 13, 11, 15, 31, 32, 30, 20};
  return ids[static_cast<std::size_t>(kind)];
}

std::uint16_t moving_label(ObjectKind kind) {
  constexpr std::array<std::uint16_t, 9> ids{252, 258, 257, 11, 15, 253, 255, 254, 259};
  return ids[static_cast<std::size_t>(kind)];
}

ObjectShape make_object(ObjectKind kind, Random random, Variety variety) {
  return measured(kind, mesh_of(kind, variety, random));
}

}  // namespace stillmap::simulation
