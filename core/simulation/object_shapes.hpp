#pragma once

#include <cstdint>
#include <vector>

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// Kind of an object; determines its SemanticKITTI ids.
enum class ObjectKind : std::uint8_t {
  car,
  truck,
  bus,
  bicycle,
  motorcycle,
  bicyclist,
  motorcyclist,
  person,
  /// Caravans, trailers, tractors, diggers.
  other_vehicle,
};

/// SemanticKITTI id of a standing and of a moving object (252..259; bicycles and motorcycles
/// without a rider have no moving id and keep the standing one).
[[nodiscard]] std::uint16_t standing_label(ObjectKind kind);
[[nodiscard]] std::uint16_t moving_label(ObjectKind kind);

/// A body on the ground at the origin, front along +x [m].
struct ObjectShape {
  ObjectKind kind = ObjectKind::car;
  float length_m = 0.0F, width_m = 0.0F;
  Mesh mesh;
};

/// plain: trucks and buses are lorries and city buses of about one size. any: also tankers, box
/// vans, tippers and pick-ups; minibuses and trams.
enum class Variety : std::uint8_t { plain, any };

/// A shape of that kind: body type and size vary with `random`.
[[nodiscard]] ObjectShape make_object(ObjectKind kind, Random random,
                                      Variety variety = Variety::plain);

/// The mesh alone. `kind` is car, truck, bus or other_vehicle.
[[nodiscard]] Mesh make_vehicle(ObjectKind kind, Variety variety, Random& random);
/// The mesh alone. `kind` is one of the others.
[[nodiscard]] Mesh make_person_or_two_wheeler(ObjectKind kind, Random& random);

}  // namespace stillmap::simulation
