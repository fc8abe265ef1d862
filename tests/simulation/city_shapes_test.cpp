// Properties that all random shapes share.
#include "core/simulation/city_shapes.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "core/simulation/ray_scene.hpp"

namespace stillmap::simulation {
namespace {

Eigen::AlignedBox3f bounds(const Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  return box;
}

struct Kind {
  const char* name;
  std::function<Mesh(Random)> make;
  /// Largest horizontal coordinate, lowest and highest top [m].
  float reach, min_height, max_height;
};

std::vector<Kind> kinds() {
  return {{"tree", make_any_tree, 16.0F, 2.0F, 20.0F},
          {"bush", make_any_bush, 5.0F, 0.2F, 5.0F},
          {"hedge", [](Random r) { return make_any_hedge(3.0F, r); }, 3.5F, 0.3F, 3.5F},
          {"thicket", [](Random r) { return make_any_thicket(3.0F, r); }, 3.5F, 1.4F, 7.5F},
          {"bank", [](Random r) { return make_any_bank(3.0F, r); }, 15.5F, 0.7F, 6.5F},
          {"fence", [](Random r) { return make_any_fence(3.0F, r); }, 3.5F, 0.5F, 2.8F},
          {"barrier", [](Random r) { return make_any_crash_barrier(3.0F, r); }, 3.5F, 0.6F, 0.9F},
          {"wall", [](Random r) { return make_any_wall(3.0F, r); }, 3.5F, 0.35F, 3.5F},
          {"light", make_any_street_light, 4.0F, 2.9F, 10.5F},
          {"pole", make_any_pole, 0.2F, 0.5F, 9.1F},
          {"sign", make_any_sign, 2.5F, 1.0F, 7.0F},
          {"object", make_street_object, 4.0F, 0.3F, 3.5F},
          {"shelter", make_shelter, 3.0F, 2.2F, 2.6F}};
}

TEST(AnyShape, StandsInTheGroundAndHasItsSize) {
  for (const Kind& kind : kinds()) {
    for (std::uint64_t seed = 0; seed < 60; ++seed) {
      SCOPED_TRACE(kind.name + std::string(" of seed ") + std::to_string(seed));
      const Mesh mesh = kind.make(Random(seed));
      ASSERT_EQ(mesh.surfaces.size(), mesh.triangles.size());
      ASSERT_LT(mesh.triangles.size(), 30000U);
      const Eigen::AlignedBox3f box = bounds(mesh);
      EXPECT_LE(box.min().z(), 0.1F);
      EXPECT_GE(box.max().z(), kind.min_height);
      EXPECT_LE(box.max().z(), kind.max_height);
      EXPECT_LT(box.max().head<2>().cwiseAbs().maxCoeff(), kind.reach);
      EXPECT_LT(box.min().head<2>().cwiseAbs().maxCoeff(), kind.reach);
    }
  }
}

TEST(AnyShape, DrawsAgainTheSameAndOtherwiseAnother) {
  for (const Kind& kind : kinds()) {
    EXPECT_EQ(kind.make(Random(1)).vertices, kind.make(Random(1)).vertices) << kind.name;
    EXPECT_NE(kind.make(Random(1)).vertices, kind.make(Random(2)).vertices) << kind.name;
  }
}

// Share of horizontal rays, 0.3 to 0.9 m high, that one field stops.
double opacity(const Mesh& mesh) {
  const StandingMesh standing{0, Eigen::Isometry3d::Identity()};
  const RayScene scene({&mesh}, std::span(&standing, 1));
  const RaySnapshot snapshot = scene.with({});
  int stopped = 0;
  constexpr int rays = 900;
  for (int i = 0; i < rays; ++i) {
    const float x = 0.2F + 2.6F * static_cast<float>(i % 30) / 30.0F;
    const float z = 0.3F + 0.6F * static_cast<float>(i / 30) / 30.0F;
    stopped += snapshot.cast({{x, -5, z}, {0, 1, 0}, 10.0F}) ? 1 : 0;
  }
  return static_cast<double>(stopped) / rays;
}

TEST(AnyShape, FencesAreSeenThroughMoreOrLess) {
  int dense = 0, loose = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const double share = opacity(make_any_fence(3.0F, Random(seed)));
    EXPECT_GT(share, 0.02) << seed;
    dense += share > 0.8 ? 1 : 0;
    loose += share < 0.5 ? 1 : 0;
  }
  EXPECT_GT(dense, 3);
  EXPECT_GT(loose, 15);
}

// Ranges to a field from 5 m beside it, along a line 0.3 m high; rays that pass it left out.
std::vector<float> ranges_along(const Mesh& mesh) {
  const StandingMesh standing{0, Eigen::Isometry3d::Identity()};
  const RayScene scene({&mesh}, std::span(&standing, 1));
  const RaySnapshot snapshot = scene.with({});
  std::vector<float> ranges_m;
  for (int i = 0; i < 200; ++i) {
    const float x = 0.1F + 2.8F * static_cast<float>(i) / 200.0F;
    if (const auto hit = snapshot.cast({{x, -5, 0.3F}, {0, 1, 0}, 10.0F}))
      ranges_m.push_back(hit->range_m);
  }
  return ranges_m;
}

TEST(AnyShape, HedgesAndThicketsAreNotBoxes) {
  for (const auto make : {make_any_hedge, make_any_thicket}) {
    for (std::uint64_t seed = 0; seed < 30; ++seed) {
      const std::vector<float> ranges_m = ranges_along(make(3.0F, Random(seed)));
      ASSERT_GT(ranges_m.size(), 100U) << seed;
      const auto [nearest, farthest] = std::ranges::minmax(ranges_m);
      EXPECT_GT(farthest - nearest, 0.01F) << seed;
    }
  }
}

TEST(AnyShape, ThicketsAreDenseOrShowWhatIsBehind) {
  int dense = 0, loose = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const double share = opacity(make_any_thicket(3.0F, Random(seed)));
    EXPECT_GT(share, 0.5) << seed;
    dense += share > 0.98 ? 1 : 0;
    loose += share < 0.95 ? 1 : 0;
  }
  EXPECT_GT(dense, 10);
  EXPECT_GT(loose, 5);
}

TEST(AnyShape, OutbuildingsStandOutOfTheFront) {
  BuildingPlan plan{.width_m = 12,
                    .depth_m = 9,
                    .floors = 2,
                    .gabled = true,
                    .balconies = false,
                    .wall = Surface::plaster};
  const Mesh bare = make_building(plan, Random(8));
  plan.outbuildings = true;
  float furthest = 0.0F;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    furthest = std::min(furthest, bounds(make_building(plan, Random(seed))).min().y());
  }
  EXPECT_LT(furthest, bounds(bare).min().y() - 0.5F);
}

}  // namespace
}  // namespace stillmap::simulation
