#include "core/simulation/object_shapes.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

#include "core/simulation/people.hpp"
#include "core/simulation/vehicles.hpp"

namespace stillmap {
namespace {

ObjectShape measured(ObjectKind kind, Mesh mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  // The longer half counts twice: shapes need not be centred on their origin exactly.
  const float length = 2.0F * std::max(box.max().x(), -box.min().x());
  const float width = 2.0F * std::max(box.max().y(), -box.min().y());
  return {kind, length, width, std::move(mesh)};
}

Mesh mesh_of(ObjectKind kind, Random& random) {
  switch (kind) {
    case ObjectKind::car:
      return make_car(random);
    case ObjectKind::truck:
      return make_truck(random);
    case ObjectKind::bus:
      return make_bus();
    case ObjectKind::bicycle:
      return make_bicycle();
    case ObjectKind::motorcycle:
      return make_motorcycle();
    case ObjectKind::bicyclist:
      return make_bicyclist();
    case ObjectKind::motorcyclist:
      return make_motorcyclist();
    case ObjectKind::person:
      return make_person(random);
  }
  assert(false);
  return {};
}

}  // namespace

std::uint16_t standing_label(ObjectKind kind) {
  constexpr std::array<std::uint16_t, 8> ids{10, 18, 13, 11, 15, 31, 32, 30};
  return ids[static_cast<std::size_t>(kind)];
}

std::uint16_t moving_label(ObjectKind kind) {
  constexpr std::array<std::uint16_t, 8> ids{252, 258, 257, 11, 15, 253, 255, 254};
  return ids[static_cast<std::size_t>(kind)];
}

ObjectShape make_object(ObjectKind kind, Random random) {
  return measured(kind, mesh_of(kind, random));
}

}  // namespace stillmap
