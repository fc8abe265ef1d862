#include "core/simulation/city.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/simulation/city_shapes.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::AlignedBox2d;
using Eigen::Vector2d;

struct Interval {
  double low, high;
  bool street_below, street_above;
};

// Extents of the blocks on one axis: between the backs of the sidewalks.
std::vector<Interval> block_intervals(const std::vector<StreetPlan>& streets, double margin) {
  std::vector<Interval> out;
  double low = streets.front().position_m - margin;
  for (std::size_t i = 0; i < streets.size(); ++i) {
    const double half = streets[i].profile.half_street_m();
    out.push_back({low, streets[i].position_m - half, i > 0, true});
    low = streets[i].position_m + half;
  }
  out.push_back({low, streets.back().position_m + margin, true, false});
  return out;
}

// One side of a block: the block lies to the left of `along`.
struct Frontage {
  Vector2d start, along;
  double length_m;

  [[nodiscard]] Vector2d inward() const { return {-along.y(), along.x()}; }
  [[nodiscard]] Vector2d at(double along_m, double inward_m) const {
    return start + along_m * along + inward_m * inward();
  }
  [[nodiscard]] double heading() const { return std::atan2(along.y(), along.x()); }
};

std::vector<Frontage> frontages(const Interval& u, const Interval& v) {
  std::vector<Frontage> out;
  if (v.street_below) out.push_back({{u.low, v.low}, {1, 0}, u.high - u.low});
  if (u.street_above) out.push_back({{u.high, v.low}, {0, 1}, v.high - v.low});
  if (v.street_above) out.push_back({{u.high, v.high}, {-1, 0}, u.high - u.low});
  if (u.street_below) out.push_back({{u.low, v.high}, {0, -1}, v.high - v.low});
  return out;
}

// Shapes in gardens. Hedges, fences, walls, thickets and banks are fields of `enclosure_m`.
struct GardenShapes {
  ShapeRange trees, bushes, hedges, fences, walls, thickets, banks, barriers;
};

constexpr double enclosure_m = 3.0;

// A few plain shapes, or many of any kind.
GardenShapes add_garden_shapes(City& city, bool many, Random& random) {
  constexpr auto field_m = static_cast<float>(enclosure_m);
  const auto fork = [&] { return random.fork(); };
  GardenShapes shapes;
  if (many) {
    shapes.trees = city.add_shapes(10, [&] { return make_any_tree(fork()); });
    shapes.bushes = city.add_shapes(6, [&] { return make_any_bush(fork()); });
    shapes.hedges = city.add_shapes(4, [&] { return make_any_hedge(field_m, fork()); });
    shapes.fences = city.add_shapes(6, [&] { return make_any_fence(field_m, fork()); });
    shapes.walls = city.add_shapes(3, [&] { return make_any_wall(field_m, fork()); });
    shapes.thickets = city.add_shapes(5, [&] { return make_any_thicket(field_m, fork()); });
    shapes.banks = city.add_shapes(3, [&] { return make_any_bank(field_m, fork()); });
    shapes.barriers = city.add_shapes(2, [&] { return make_any_crash_barrier(field_m, fork()); });
    return shapes;
  }
  shapes.trees = city.add_shapes(8, [&] { return make_tree(fork()); });
  shapes.bushes = city.add_shapes(4, [&] { return make_bush(random.between(0.7, 1.6), fork()); });
  shapes.hedges = city.add_shapes(
      3, [&] { return make_hedge(field_m, random.between(0.9, 1.7), 0.7F, fork()); });
  shapes.fences = city.add_shapes(1, [&] { return make_railing(field_m); });
  shapes.fences.count += city.add_shapes(1, [&] { return make_wooden_fence(field_m); }).count;
  shapes.walls = city.add_shapes(1, [&] { return make_garden_wall(field_m); });
  // No plain city has any; hedges and fences are drawn where a plan asks for them nevertheless.
  shapes.thickets = shapes.banks = shapes.hedges;
  shapes.barriers = shapes.fences;
  return shapes;
}

/// Fills one block, side after side.
class BlockFiller {
 public:
  BlockFiller(City& city, const GroundShape& ground, const GardenShapes& shapes, Random random)
      : city_(city), ground_(ground), shapes_(shapes), random_(random) {}

  void fill(const Interval& u, const Interval& v) {
    const BlockPlan& plan = ground_.plan().blocks;
    block_ = AlignedBox2d(Vector2d(u.low, v.low), Vector2d(u.high, v.high));
    houses_.clear();
    double draw =
        plan.share_open + plan.share_wood + plan.share_halls > 0.0 ? random_.uniform() : 1.0;
    const auto falls_to = [&](double share) { return (draw -= share) < 0.0; };
    const bool open = falls_to(plan.share_open);
    const bool wood = !open && falls_to(plan.share_wood);
    halls_ = !open && !wood && falls_to(plan.share_halls);
    const std::vector<Frontage> sides = frontages(u, v);
    for (const Frontage& side : sides) {
      if (open || wood) {
        if (plan.share_barrier > 0.0 && random_.chance(plan.share_barrier)) {
          add_barrier(side);
        } else if (random_.chance(0.4)) {
          enclose(side, 0.0, side.length_m);
        }
        if (plan.share_thicket > 0.0 && random_.chance(wood ? 0.7 : 0.4)) overgrow(side);
      } else {
        add_lots(side);
      }
    }
    for (const Frontage& side : sides) {
      if (wood) {
        scatter(side, random_.uniform(50.0, 140.0), random_.uniform(0.5, 6.0), 25.0);
        scatter(side, random_.uniform(0.0, 25.0), 0.5, 3.0);
      } else if (open) {
        scatter(side, random_.uniform(0.0, 10.0), 1.5, 40.0);
      } else {
        scatter(side, plan.garden_trees_per_100m, 1.3, plan.setback_max_m + 4.0);
      }
    }
  }

 private:
  void add_lots(const Frontage& side) {
    const BlockPlan& plan = ground_.plan().blocks;
    double at = random_.uniform(0.0, 2.0);
    while (at + 8.0 < side.length_m) {
      const double wish = halls_ ? random_.uniform(18.0, 40.0) : random_.uniform(9.0, 19.0);
      const double width = std::min(wish, side.length_m - at);
      add_house(side, at, width);
      enclose(side, at, width);
      at += width + random_.uniform(plan.gap_min_m, plan.gap_max_m);
    }
  }

  void add_house(const Frontage& side, double at, double width) {
    const BlockPlan& plan = ground_.plan().blocks;
    const double setback = random_.uniform(plan.setback_min_m, plan.setback_max_m);
    const double depth = halls_ ? random_.uniform(12.0, 20.0) : random_.uniform(8.0, 12.0);
    AlignedBox2d foot;
    foot.extend(side.at(at, setback)).extend(side.at(at + width, setback + depth));
    const bool taken =
        std::ranges::any_of(houses_,
                            [&](const AlignedBox2d& house) { return house.intersects(foot); }) ||
        std::ranges::any_of(ground_.plan().patches, [&](const GroundPatch& patch) {
          return patch.area_plan.intersects(foot);
        });
    if (taken || !block_.contains(foot)) return;
    houses_.push_back(foot);
    place(make_building(random_house(width, depth), random_.fork()), foot.center(), side.heading());
  }

  BuildingPlan random_house(double width, double depth) {
    const BlockPlan& plan = ground_.plan().blocks;
    const auto spread = static_cast<std::size_t>(plan.floors_max - plan.floors_min + 1);
    BuildingPlan house{.width_m = static_cast<float>(width - 0.2),
                       .depth_m = static_cast<float>(depth),
                       .floors = plan.floors_min + static_cast<int>(random_.index(spread)),
                       .gabled = random_.chance(0.5),
                       .balconies = random_.chance(0.45),
                       .wall = random_.chance(0.6) ? Surface::plaster : Surface::brick};
    if (!ground_.plan().many_shapes) return house;
    house.outbuildings = !halls_;
    house.share_windows =
        static_cast<float>(halls_ ? random_.uniform(0.0, 0.3) : random_.uniform(0.1, 1.0));
    house.balconies = house.balconies && !halls_;
    return house;
  }

  // Fence, hedge, wall or thicket between the sidewalk and the lot, with a gate.
  void enclose(const Frontage& side, double at, double width) {
    const BlockPlan& plan = ground_.plan().blocks;
    const double kind = random_.uniform();
    const std::size_t fence = shapes_.fences.draw(random_);
    const double gate = at + random_.uniform(0.2, 0.8) * width;
    for (double x = at; x + enclosure_m <= at + width; x += enclosure_m) {
      if (gate > x - 0.2 && gate < x + enclosure_m) continue;
      const Vector2d spot = side.at(x, 0.45);
      if (ground_.zone(side.at(x + 1.5, 1.0)) != Zone::lot) continue;
      if (kind < plan.share_fence) {
        plant(fence, spot, side.heading());
      } else if (kind < plan.share_fence + plan.share_hedge) {
        plant(shapes_.hedges.draw(random_), spot, side.heading());
      } else if (kind < plan.share_fence + plan.share_hedge + plan.share_wall) {
        plant(shapes_.walls.first + fence % shapes_.walls.count, spot, side.heading());
      } else if (kind <
                 plan.share_fence + plan.share_hedge + plan.share_wall + plan.share_thicket) {
        plant(shapes_.thickets.draw(random_), side.at(x, 1.5), side.heading());
      }
    }
  }

  // A crash barrier along the whole side.
  void add_barrier(const Frontage& side) {
    const std::size_t barrier = shapes_.barriers.draw(random_);
    const double from_m = random_.uniform(0.2, 1.5);
    for (double x = 0.0; x + enclosure_m <= side.length_m; x += enclosure_m) {
      if (ground_.zone(side.at(x + 1.5, from_m)) != Zone::lot) continue;
      plant(barrier, side.at(x, from_m), side.heading());
    }
  }

  // A thicket or a bank along the whole side, some metres behind the street, nearer and farther in
  // pieces.
  void overgrow(const Frontage& side) {
    const bool is_bank = random_.chance(0.4);
    const std::size_t bank = shapes_.banks.draw(random_);
    const double from_m = random_.uniform(is_bank ? 0.3 : 1.5, is_bank ? 3.0 : 8.0);
    const double uneven_m = random_.uniform(0.0, is_bank ? 0.3 : 1.5);
    for (double x = 0.0; x + enclosure_m <= side.length_m; x += enclosure_m) {
      const Vector2d spot = side.at(x, from_m + random_.uniform(-0.5, 0.5) * uneven_m);
      if (ground_.zone(side.at(x + 1.5, from_m)) != Zone::lot) continue;
      if (!is_bank && random_.chance(0.1)) continue;
      plant(is_bank ? bank : shapes_.thickets.draw(random_), spot, side.heading());
    }
  }

  // Trees and twice as many bushes, `from_m` to `to_m` behind the street.
  void scatter(const Frontage& side, double trees_per_100m, double from_m, double to_m) {
    const auto wanted = static_cast<int>(trees_per_100m * side.length_m / 100.0);
    for (int i = 0; i < 3 * wanted; ++i) {
      const bool tree = i < wanted;
      const Vector2d spot =
          side.at(random_.uniform(2.0, side.length_m - 2.0), random_.uniform(from_m, to_m));
      const double clear = tree ? 1.2 : 0.6;
      const bool blocked = std::ranges::any_of(
          houses_, [&](const AlignedBox2d& house) { return house.exteriorDistance(spot) < clear; });
      if (blocked || !block_.contains(spot) || ground_.zone(spot) != Zone::lot) continue;
      plant(tree ? shapes_.trees.draw(random_) : shapes_.bushes.draw(random_), spot,
            random_.uniform(0.0, 6.28));
    }
  }

  void place(const Mesh& mesh, const Vector2d& spot, double heading) {
    city_.fixed.append(mesh, ground_.frame_at(spot, heading).cast<float>());
  }

  void plant(std::size_t shape, const Vector2d& spot, double heading) {
    city_.bodies.push_back({.shape = shape, .T_map_body = ground_.frame_at(spot, heading)});
  }

  City& city_;
  const GroundShape& ground_;
  const GardenShapes& shapes_;
  Random random_;
  AlignedBox2d block_;
  std::vector<AlignedBox2d> houses_;
  bool halls_ = false;
};

}  // namespace

std::uint16_t City::next_instance() {
  assert(instances < std::numeric_limits<std::uint16_t>::max());
  return ++instances;
}

std::vector<const Mesh*> City::meshes() const {
  std::vector<const Mesh*> meshes{&fixed};
  for (const Mesh& shape : shapes) meshes.push_back(&shape);
  return meshes;
}

std::vector<StandingMesh> City::standing_meshes() const {
  std::vector<StandingMesh> standing{{0, Eigen::Isometry3d::Identity()}};
  for (const Body& body : bodies) standing.push_back({body.shape + 1, body.T_map_body});
  return standing;
}

City build_city(const GroundShape& ground, std::uint64_t seed, std::uint64_t day_seed) {
  City city;
  add_ground(city.fixed, ground);
  add_lane_markings(city.fixed, ground);
  fill_blocks(city, ground, Random(seed, 21));
  park_vehicles(city, ground, Random(day_seed, 23));
  furnish_streets(city, ground, Random(seed, 22));
  return city;
}

void fill_blocks(City& city, const GroundShape& ground, Random random) {
  const CityPlan& plan = ground.plan();
  const GardenShapes shapes = add_garden_shapes(city, plan.many_shapes, random);
  BlockFiller filler(city, ground, shapes, random);
  for (const Interval& u : block_intervals(plan.streets_along_v, plan.margin_m)) {
    for (const Interval& v : block_intervals(plan.streets_along_u, plan.margin_m)) {
      filler.fill(u, v);
    }
  }
}

}  // namespace stillmap::simulation
