#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "core/simulation/city_shapes.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector3f;

// Measures of a tree.
struct TreePlan {
  float height_m, trunk_m, spread_m, radius_m, leaf_m;
  /// Leaf area relative to the crown's outline from the side.
  float cover;
  bool conifer;
};

TreePlan random_tree(Random& random) {
  TreePlan tree{};
  tree.height_m = random.between(3.0, random.chance(0.5) ? 16.0 : 9.0);
  tree.conifer = random.chance(0.15);
  const double bare = tree.conifer ? random.uniform(0.03, 0.2) : random.uniform(0.06, 0.45);
  tree.trunk_m = static_cast<float>(bare) * tree.height_m;
  tree.spread_m = random.between(0.16, 0.42) * tree.height_m;
  tree.radius_m = random.between(0.01, 0.028) * tree.height_m;
  tree.leaf_m = random.between(0.09, 0.28);
  tree.cover = random.between(0.35, 1.6);
  return tree;
}

// Leaves that cover an ellipsoid's outline `tree.cover` times.
Foliage foliage_of(const TreePlan& tree, const Vector3f& radii) {
  const float outline = std::numbers::pi_v<float> * radii.x() * radii.z();
  const float leaf = 0.6F * tree.leaf_m * tree.leaf_m;
  const int leaves = std::clamp(static_cast<int>(tree.cover * outline / leaf), 20, 1500);
  return {.leaves = leaves, .leaf_m = tree.leaf_m, .depth_power = 0.45};
}

void add_limbs(Mesh& mesh, const TreePlan& tree, const Vector3f& foot, const Vector3f& top,
               Random& random) {
  const std::size_t limbs = 4 + random.index(6);
  for (std::size_t i = 0; i < limbs; ++i) {
    const float part = random.between(0.55, 1.0);
    const Vector3f start = foot + part * (top - foot);
    const double angle = random.uniform(0.0, 2.0 * std::numbers::pi);
    const float reach = random.between(0.3, 0.9) * tree.spread_m;
    const Vector3f end = start + Vector3f(reach * std::cos(static_cast<float>(angle)),
                                          reach * std::sin(static_cast<float>(angle)),
                                          random.between(0.1, 0.8) * reach);
    add_tube(mesh, {start, end, 0.35F * tree.radius_m, 0.08F * tree.radius_m, 5}, Surface::bark);
  }
}

// Three stakes round a young tree, tied at their tops.
void add_stakes(Mesh& mesh, Random& random) {
  const float reach = random.between(0.3, 0.8);
  const float height = random.between(1.3, 2.2);
  const float inwards = random.between(0.6, 1.0);
  std::array<Vector3f, 3> tops;
  for (std::size_t i = 0; i < tops.size(); ++i) {
    const float angle = 2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / 3.0F;
    const Vector3f out(reach * std::cos(angle), reach * std::sin(angle), 0);
    tops[i] = inwards * out + Vector3f(0, 0, height);
    add_tube(mesh, {out - Vector3f(0, 0, 0.4F), tops[i], 0.04F, 0.04F, 5}, Surface::bark);
  }
  for (std::size_t i = 0; i < tops.size(); ++i) {
    add_tube(mesh, {tops[i], tops[(i + 1) % tops.size()], 0.025F, 0.025F, 5}, Surface::bark);
  }
}

void add_broad_crown(Mesh& mesh, const TreePlan& tree, const Vector3f& top, Random& random) {
  const float crown_m = tree.height_m - tree.trunk_m;
  const std::size_t blobs = 3 + random.index(5);
  for (std::size_t i = 0; i < blobs; ++i) {
    const double angle = 2.0 * std::numbers::pi * random.uniform();
    const float out = random.between(0.0, 0.65) * tree.spread_m;
    const Vector3f centre = top + Vector3f(out * std::cos(static_cast<float>(angle)),
                                           out * std::sin(static_cast<float>(angle)),
                                           random.between(0.15, 0.8) * crown_m);
    const float wide = random.between(0.45, 0.8) * tree.spread_m;
    const Vector3f radii(wide, wide, std::min(random.between(0.2, 0.4) * crown_m, 1.5F * wide));
    add_leaf_ball(mesh, centre, radii, foliage_of(tree, radii), random);
  }
}

void add_conifer_crown(Mesh& mesh, const TreePlan& tree, const Vector3f& top, Random& random) {
  const float crown_m = tree.height_m - tree.trunk_m;
  constexpr int tiers = 6;
  for (int tier = 0; tier < tiers; ++tier) {
    const float part = (static_cast<float>(tier) + 0.5F) / tiers;
    const float wide = 0.8F * tree.spread_m * (1.1F - part);
    const Vector3f radii(wide, wide, 0.7F * crown_m / tiers);
    add_leaf_ball(mesh, top + Vector3f(0, 0, part * crown_m), radii, foliage_of(tree, radii),
                  random);
  }
}

// Leaves between the neighbours of a grid of `columns` vertices a row; `open` is the share left
// out.
void add_sheet(Mesh& mesh, const std::vector<Vector3f>& grid, std::size_t columns, double open,
               Random& random) {
  for (std::size_t i = 0; i + columns < grid.size(); ++i) {
    if (i % columns + 1 == columns || (open > 0.0 && random.chance(open))) continue;
    mesh.add_quad(grid[i], grid[i + 1], grid[i + columns + 1], grid[i + columns], Surface::hedge);
  }
}

// A wall of leaves along x; `open` is the share of it that rays pass.
struct LeafyWall {
  float length_m, height_m, depth_m, bump_m;
  double open;
};

// Both fronts, round towards the top, of pieces that stand out by up to `bump_m`.
void add_leafy_fronts(Mesh& mesh, const LeafyWall& wall, Random& random) {
  constexpr float piece_m = 0.25F;
  constexpr float buried_m = 0.4F;
  const auto columns = static_cast<std::size_t>(std::lround(wall.length_m / piece_m)) + 1;
  const auto rows = static_cast<std::size_t>(std::lround((wall.height_m + buried_m) / piece_m)) + 1;
  std::vector<Vector3f> front(columns * rows);
  for (const float side : {-1.0F, 1.0F}) {
    for (std::size_t i = 0; i < front.size(); ++i) {
      const float up = static_cast<float>(i / columns) / static_cast<float>(rows - 1);
      const float half = 0.5F * wall.depth_m * std::sqrt(1.0F - 0.9F * up * up * up * up);
      const float out = half + wall.bump_m * random.between(-1.0, 1.0);
      front[i] = {piece_m * static_cast<float>(i % columns), side * out,
                  up * (wall.height_m + buried_m) - buried_m +
                      up * wall.bump_m * random.between(-0.5, 0.5)};
    }
    add_sheet(mesh, front, columns, wall.open, random);
  }
}

void add_leafy_wall(Mesh& mesh, const LeafyWall& wall, Random& random) {
  add_leafy_fronts(mesh, wall, random);
  const auto leaves = static_cast<int>(10.0F * wall.length_m * wall.height_m);
  const float leaf_m = random.between(0.06, 0.2);
  for (int i = 0; i < leaves; ++i) {
    const float out = 0.5F * wall.depth_m + wall.bump_m * random.between(-0.5, 1.5);
    const Vector3f spot(random.between(0.0, 1.0) * wall.length_m, random.chance(0.5) ? out : -out,
                        random.between(0.0, 1.05) * wall.height_m);
    add_leaf(mesh, spot, leaf_m, random, Surface::hedge);
  }
}

}  // namespace

Mesh make_tree(Random random) {
  Mesh mesh;
  const float trunk_m = random.between(2.2, 3.4);
  const float spread_m = random.between(1.3, 2.2);
  const float radius_m = random.between(0.12, 0.24);
  const Vector3f fork(0.1F, 0.05F, trunk_m);
  add_tube(mesh, {{0, 0, -0.3F}, fork, 1.2F * radius_m, 0.8F * radius_m}, Surface::bark);
  const int blobs = 4 + static_cast<int>(random.index(3));
  for (int i = 0; i < blobs; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / blobs + random.uniform(-0.4, 0.4);
    const Eigen::Vector3d reach(std::cos(angle) * 0.6, std::sin(angle) * 0.6,
                                random.uniform(0.4, 1.6));
    const Vector3f blob = fork + spread_m * reach.cast<float>();
    add_tube(mesh, {fork, blob, 0.4F * radius_m, 0.1F * radius_m, 5}, Surface::bark);
    const float size = random.between(0.6, 0.85) * spread_m;
    add_leaf_ball(mesh, blob, {size, size, 0.8F * size}, {}, random);
  }
  return mesh;
}

Mesh make_any_tree(Random random) {
  Mesh mesh;
  const TreePlan tree = random_tree(random);
  const float lean = random.chance(0.3) ? 0.15F : 0.04F;
  const Vector3f top(random.between(-lean, lean) * tree.trunk_m,
                     random.between(-lean, lean) * tree.trunk_m, tree.trunk_m);
  const Vector3f foot(0, 0, -0.4F);
  const std::size_t stems = random.chance(0.12) ? 3 : 1;
  for (std::size_t i = 0; i < stems; ++i) {
    const Vector3f apart = i == 0
                               ? Vector3f::Zero().eval()
                               : Vector3f(random.between(-0.4, 0.4), random.between(-0.4, 0.4), 0);
    add_tube(mesh,
             {foot + 0.3F * apart, top + apart, 1.15F * tree.radius_m, 0.7F * tree.radius_m, 9},
             Surface::bark);
  }
  const Vector3f tip = top + Vector3f(0, 0, 0.7F * (tree.height_m - tree.trunk_m));
  add_tube(mesh, {top, tip, 0.7F * tree.radius_m, 0.1F * tree.radius_m, 6}, Surface::bark);
  add_limbs(mesh, tree, foot, tip, random);
  if (tree.height_m < 7.0F && random.chance(0.3)) add_stakes(mesh, random);
  if (tree.conifer) {
    add_conifer_crown(mesh, tree, top, random);
  } else {
    add_broad_crown(mesh, tree, top, random);
  }
  return mesh;
}

Mesh make_bush(float size_m, Random random) {
  Mesh mesh;
  const Vector3f radii(0.5F * size_m, 0.5F * size_m, 0.45F * size_m);
  add_leaf_ball(mesh, {0, 0, 0.4F * size_m}, radii,
                {.leaves = static_cast<int>(260.0F * size_m), .leaf_m = 0.12F}, random);
  return mesh;
}

Mesh make_any_bush(Random random) {
  Mesh mesh;
  const float size = random.between(0.5, random.chance(0.5) ? 3.5 : 1.6);
  const std::size_t tufts = 1 + random.index(4);
  const float leaf = random.between(0.06, 0.16);
  const float cover = random.between(0.5, 2.5);
  for (std::size_t i = 0; i < tufts; ++i) {
    const float wide = random.between(0.3, 0.6) * size;
    const Vector3f radii(wide, wide, random.between(0.3, 0.55) * size);
    const Vector3f centre(random.between(-0.4, 0.4) * size, random.between(-0.4, 0.4) * size,
                          0.8F * radii.z());
    const float outline = std::numbers::pi_v<float> * radii.x() * radii.z();
    const int leaves =
        std::clamp(static_cast<int>(cover * outline / (0.6F * leaf * leaf)), 30, 900);
    add_leaf_ball(mesh, centre, radii, {.leaves = leaves, .leaf_m = leaf}, random);
  }
  return mesh;
}

Mesh make_hedge(float length_m, float height_m, float depth_m, Random random) {
  Mesh mesh;
  const auto leaves = static_cast<int>(150.0F * length_m * height_m);
  for (int i = 0; i < leaves; ++i) {
    const Eigen::Vector3d spot(random.uniform(0.0, length_m), random.uniform(-0.5, 0.5) * depth_m,
                               random.uniform(0.02, 1.0) * height_m);
    add_leaf(mesh, spot.cast<float>(), 0.12F, random, Surface::hedge);
  }
  // Twigs inside: opaque below the top.
  add_box(mesh, {0, -0.3F * depth_m, -0.3F}, {length_m, 0.3F * depth_m, 0.85F * height_m},
          Surface::hedge);
  return mesh;
}

Mesh make_any_hedge(float length_m, Random random) {
  Mesh mesh;
  const float height = random.between(0.5, random.chance(0.5) ? 3.0 : 1.8);
  const float depth = random.between(0.4, 1.2);
  if (random.chance(0.6)) {
    const float bump = random.between(0.01, random.chance(0.5) ? 0.2 : 0.06);
    add_leafy_wall(mesh, {length_m, height, depth, bump, random.uniform(0.0, 0.05)}, random);
    return mesh;
  }
  const float uneven = random.chance(0.3) ? 0.3F : 0.1F;
  constexpr float piece_m = 0.25F;
  for (float x = 0.0F; x < length_m; x += piece_m) {
    const float top = height * (1.0F - uneven * random.between(0.0, 1.0));
    const float half = 0.5F * depth * (1.0F - 0.5F * random.between(0.0, 1.0));
    add_frustum(mesh, {x, x + piece_m, half, -0.4F}, {x, x + piece_m, 0.8F * half, 0.9F * top},
                Surface::hedge, Surface::hedge);
    for (int i = 0; i < 18; ++i) {
      const Vector3f spot(x + piece_m * random.between(0.0, 1.0), random.between(-0.6, 0.6) * depth,
                          random.between(0.02, 1.08) * top);
      add_leaf(mesh, spot, 0.09F, random, Surface::hedge);
    }
  }
  return mesh;
}

Mesh make_any_thicket(float length_m, Random random) {
  Mesh mesh;
  const float height = random.between(1.8, random.chance(0.5) ? 7.0 : 4.0);
  const float depth = random.between(0.8, 3.0);
  const float bump = random.between(0.04, random.chance(0.5) ? 0.6 : 0.2);
  add_leafy_wall(mesh, {length_m, height, depth, bump, random.uniform(0.0, 0.3)}, random);
  return mesh;
}

Mesh make_any_bank(float length_m, Random random) {
  Mesh mesh;
  const float height = random.between(0.8, random.chance(0.5) ? 5.0 : 2.5);
  const float depth = height * random.between(1.2, 3.0);
  const float bump = random.between(0.03, 0.35);
  constexpr float piece_m = 0.3F;
  const auto columns = static_cast<std::size_t>(std::lround(length_m / piece_m)) + 1;
  const auto rows = static_cast<std::size_t>(std::lround(depth / piece_m)) + 1;
  std::vector<Vector3f> slope(columns * rows);
  for (std::size_t i = 0; i < slope.size(); ++i) {
    const float in = static_cast<float>(i / columns) / static_cast<float>(rows - 1);
    slope[i] = {piece_m * static_cast<float>(i % columns), in * depth,
                (in > 0.0F ? 0.2F : -0.4F) + in * height + bump * random.between(-1.0, 1.0)};
  }
  add_sheet(mesh, slope, columns, 0.0, random);
  const auto leaves = static_cast<int>(6.0F * length_m * depth);
  const float leaf_m = random.between(0.06, 0.2);
  for (int i = 0; i < leaves; ++i) {
    const float in = random.between(0.0, 1.0);
    const Vector3f spot(random.between(0.0, 1.0) * length_m, in * depth,
                        0.2F + in * height + bump * random.between(0.0, 2.0));
    add_leaf(mesh, spot, leaf_m, random, Surface::hedge);
  }
  return mesh;
}

}  // namespace stillmap::simulation
