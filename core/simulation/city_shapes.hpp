#pragma once

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

// Meshes of what stands in a city, in their own frame: foot near z = 0, lengths in metres. `make_X`
// gives one plain shape, `make_any_X` draws kind and size too.

/// A house: its front looks along -y, its foot is centred on the origin [m].
struct BuildingPlan {
  float width_m, depth_m;
  int floors;
  bool gabled;
  bool balconies;
  Surface wall;
  /// Share of bays that have a window.
  float share_windows = 1.0F;
  /// Porches, bay windows, garages and steps in front.
  bool outbuildings = false;
};

/// Walls with recessed windows, doors, pilasters, sills and balconies; a gabled roof or a flat one
/// with a parapet. Reaches 3 m below the ground, so that it stands on slopes.
[[nodiscard]] Mesh make_building(const BuildingPlan& plan, Random random);

/// A tree on the origin: trunk, limbs, and a crown of single leaf bundles with gaps between them
/// that rays pass.
[[nodiscard]] Mesh make_tree(Random random);
/// Broad or slender, conifer, bare or with branches down to the ground, 3 to 15 m high, upright or
/// leaning.
[[nodiscard]] Mesh make_any_tree(Random random);

/// A bush on the origin, about `size_m` wide.
[[nodiscard]] Mesh make_bush(float size_m, Random random);
/// 0.5 to 3.5 m wide: dense, loose, or of several tufts.
[[nodiscard]] Mesh make_any_bush(Random random);

// Hedges, thickets, banks, fences and walls reach from the origin `length_m` along x.

[[nodiscard]] Mesh make_hedge(float length_m, float height_m, float depth_m, Random random);
/// Uneven in height and depth.
[[nodiscard]] Mesh make_any_hedge(float length_m, Random random);
/// Brush, or the edge of a wood: 1.8 to 7 m high, bumpy, with holes or without.
[[nodiscard]] Mesh make_any_thicket(float length_m, Random random);
/// An overgrown slope that rises from the origin along y, by 0.8 to 5 m over 1 to 15 m.
[[nodiscard]] Mesh make_any_bank(float length_m, Random random);

[[nodiscard]] Mesh make_wooden_fence(float length_m);
[[nodiscard]] Mesh make_railing(float length_m);
/// Wire mesh, planks upright or across, railing, posts with rails, crash barrier.
[[nodiscard]] Mesh make_any_fence(float length_m, Random random);

/// Steel bands on posts, or concrete that widens towards its foot.
[[nodiscard]] Mesh make_any_crash_barrier(float length_m, Random random);

[[nodiscard]] Mesh make_garden_wall(float length_m);
/// Low or high, with a pier or a railing on top.
[[nodiscard]] Mesh make_any_wall(float length_m, Random random);

// Street furniture stands on the origin; x is the direction in which it faces the road.

[[nodiscard]] Mesh make_street_light();
/// 3 to 10 m: straight, with one arm or two, or a lantern.
[[nodiscard]] Mesh make_any_street_light(Random random);

/// Signal head on a pole, facing +y (against the traffic that comes from there).
[[nodiscard]] Mesh make_traffic_light();

/// Round, square or triangular plate facing +y.
[[nodiscard]] Mesh make_sign(Random random);
/// One to three plates of any size and shape at 1.8 to 3 m, facing +y; or a board on two posts.
[[nodiscard]] Mesh make_any_sign(Random random);

[[nodiscard]] Mesh make_bollard();
/// A pole 4 to 30 cm thick: bollard, mast, stump.
[[nodiscard]] Mesh make_any_pole(Random random);

/// A bin, junction box, bench, planter or advertising column (`Surface::street_object`).
[[nodiscard]] Mesh make_street_object(Random random);
/// A bus shelter, open to the road (`Surface::other_structure`).
[[nodiscard]] Mesh make_shelter(Random random);

}  // namespace stillmap::simulation
