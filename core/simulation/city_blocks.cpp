#include <algorithm>
#include <cmath>

#include "core/simulation/buildings.hpp"
#include "core/simulation/city.hpp"
#include "core/simulation/street_furniture.hpp"
#include "core/simulation/vegetation.hpp"

namespace stillmap {
namespace {

using Eigen::AlignedBox2d;
using Eigen::Vector2d;

struct Interval {
  double low, high;
  bool street_below, street_above;
};

// Where blocks are on one axis: between the backs of the sidewalks.
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

/// Fills one block, side after side.
class BlockFiller {
 public:
  BlockFiller(City& city, const GroundShape& ground, std::size_t first_plant, Random random)
      : city_(city), ground_(ground), first_plant_(first_plant), random_(random) {}

  void fill(const Interval& u, const Interval& v) {
    block_ = AlignedBox2d(Vector2d(u.low, v.low), Vector2d(u.high, v.high));
    houses_.clear();
    const std::vector<Frontage> sides = frontages(u, v);
    for (const Frontage& side : sides) add_lots(side);
    for (const Frontage& side : sides) add_garden(side);
  }

  static constexpr std::size_t trees = 8;
  static constexpr std::size_t bushes = 4;
  static constexpr std::size_t hedges = 3;

 private:
  void add_lots(const Frontage& side) {
    const BlockPlan& plan = ground_.plan().blocks;
    double at = random_.uniform(0.0, 2.0);
    while (at + 8.0 < side.length_m) {
      const double width = std::min(random_.uniform(9.0, 19.0), side.length_m - at);
      add_house(side, at, width);
      enclose(side, at, width);
      at += width + random_.uniform(plan.gap_min_m, plan.gap_max_m);
    }
  }

  void add_house(const Frontage& side, double at, double width) {
    const BlockPlan& plan = ground_.plan().blocks;
    const double setback = random_.uniform(plan.setback_min_m, plan.setback_max_m);
    const double depth = random_.uniform(8.0, 12.0);
    AlignedBox2d foot;
    foot.extend(side.at(at, setback)).extend(side.at(at + width, setback + depth));
    const bool taken = std::ranges::any_of(
        houses_, [&](const AlignedBox2d& house) { return house.intersects(foot); });
    if (taken || !block_.contains(foot)) return;
    houses_.push_back(foot);
    const auto spread = static_cast<std::size_t>(plan.floors_max - plan.floors_min + 1);
    const BuildingPlan house{.width_m = static_cast<float>(width - 0.2),
                             .depth_m = static_cast<float>(depth),
                             .floors = plan.floors_min + static_cast<int>(random_.index(spread)),
                             .gabled = random_.chance(0.5),
                             .balconies = random_.chance(0.45),
                             .wall = random_.chance(0.6) ? Surface::plaster : Surface::brick};
    place(make_building(house, Random(random_.index(1U << 30U))), foot.center(), side.heading());
  }

  // Fence, hedge or wall between the sidewalk and the lot, with a gate.
  void enclose(const Frontage& side, double at, double width) {
    const BlockPlan& plan = ground_.plan().blocks;
    const double kind = random_.uniform();
    const bool railing = random_.chance(0.5);
    constexpr double field = 3.0;
    const double gate = at + random_.uniform(0.2, 0.8) * width;
    for (double x = at; x + field <= at + width; x += field) {
      if (gate > x - 0.2 && gate < x + field) continue;
      const Vector2d spot = side.at(x, 0.45);
      if (kind < plan.share_fence) {
        place(railing ? make_railing(field) : make_wooden_fence(field), spot, side.heading());
      } else if (kind < plan.share_fence + plan.share_hedge) {
        plant(trees + bushes + random_.index(hedges), spot, side.heading());
      } else if (kind < plan.share_fence + plan.share_hedge + plan.share_wall) {
        place(make_garden_wall(field), spot, side.heading());
      }
    }
  }

  void add_garden(const Frontage& side) {
    const BlockPlan& plan = ground_.plan().blocks;
    const auto wanted = static_cast<int>(plan.garden_trees_per_100m * side.length_m / 100.0);
    for (int i = 0; i < 3 * wanted; ++i) {
      const bool tree = i < wanted;
      const Vector2d spot = side.at(random_.uniform(2.0, side.length_m - 2.0),
                                    random_.uniform(1.3, plan.setback_max_m + 4.0));
      const double clear = tree ? 1.2 : 0.6;
      const bool blocked = std::ranges::any_of(
          houses_, [&](const AlignedBox2d& house) { return house.exteriorDistance(spot) < clear; });
      if (blocked || !block_.contains(spot)) continue;
      plant(tree ? random_.index(trees) : trees + random_.index(bushes), spot,
            random_.uniform(0.0, 6.28));
    }
  }

  void place(const Mesh& mesh, const Vector2d& spot, double heading) {
    city_.fixed.append(mesh, ground_.frame_at(spot, heading).cast<float>());
  }

  void plant(std::size_t variant, const Vector2d& spot, double heading) {
    city_.bodies.push_back(
        {.shape = first_plant_ + variant, .T_map_body = ground_.frame_at(spot, heading)});
  }

  City& city_;
  const GroundShape& ground_;
  std::size_t first_plant_;
  Random random_;
  AlignedBox2d block_;
  std::vector<AlignedBox2d> houses_;
};

void add_plant_shapes(City& city, Random& random) {
  const auto fork = [&] { return Random(random.index(1U << 30U)); };
  for (std::size_t i = 0; i < BlockFiller::trees; ++i) city.shapes.push_back(make_tree(fork()));
  for (std::size_t i = 0; i < BlockFiller::bushes; ++i) {
    city.shapes.push_back(make_bush(static_cast<float>(random.uniform(0.7, 1.6)), fork()));
  }
  for (std::size_t i = 0; i < BlockFiller::hedges; ++i) {
    const auto height = static_cast<float>(random.uniform(0.9, 1.7));
    city.shapes.push_back(make_hedge(3.0F, height, 0.7F, fork()));
  }
}

}  // namespace

void fill_blocks(City& city, const GroundShape& ground, Random random) {
  const std::size_t first_plant = city.shapes.size();
  add_plant_shapes(city, random);
  BlockFiller filler(city, ground, first_plant, random);
  const CityPlan& plan = ground.plan();
  for (const Interval& u : block_intervals(plan.streets_along_v, plan.margin_m)) {
    for (const Interval& v : block_intervals(plan.streets_along_u, plan.margin_m)) {
      filler.fill(u, v);
    }
  }
}

}  // namespace stillmap
