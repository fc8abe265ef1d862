#include "core/simulation/materials.hpp"

#include <gmock/gmock.h>

namespace stillmap::simulation {
namespace {

TEST(Materials, UsualOnesAreTheTable) {
  const Materials materials = default_materials();
  for (std::size_t i = 0; i < surface_count; ++i) {
    const auto surface = static_cast<Surface>(i);
    EXPECT_EQ(materials.of(surface).label, properties_of(surface).label);
    EXPECT_EQ(materials.of(surface).reflectivity, properties_of(surface).reflectivity);
    EXPECT_EQ(materials.at(surface, {3, 4, 5}).lost, properties_of(surface).lost);
  }
  EXPECT_EQ(materials.patch({1, 2, 3}), 1.0F);
}

TEST(Materials, DrawnOnesKeepClassesAndStayPhysical) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const Materials materials = random_materials(Random(seed));
    for (std::size_t i = 0; i < surface_count; ++i) {
      const SurfaceProperties& properties = materials.properties[i];
      EXPECT_EQ(properties.label, properties_of(static_cast<Surface>(i)).label);
      EXPECT_GT(properties.reflectivity, 0.0F);
      EXPECT_LE(properties.lost, 1.0F);
      EXPECT_GE(properties.gloss, 0.0F);
      EXPECT_LT(properties.pile_m, 0.5F);
    }
  }
}

TEST(Materials, DrawnRoadsAreDarkAndBrightAndDarkerThanGrass) {
  std::vector<float> asphalt;
  int darker_than_grass = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    const Materials materials = random_materials(Random(seed));
    asphalt.push_back(materials.of(Surface::asphalt).reflectivity);
    darker_than_grass += asphalt.back() < materials.of(Surface::grass).reflectivity ? 1 : 0;
  }
  const auto [darkest, brightest] = std::ranges::minmax(asphalt);
  EXPECT_LT(darkest, 0.12F);
  EXPECT_GT(brightest, 0.25F);
  EXPECT_GT(darker_than_grass, 95);
}

TEST(Materials, PatchesAverageToOneWithinTheirStrength) {
  Materials materials = default_materials();
  materials.patchiness = 0.4;
  double sum = 0.0;
  constexpr int spots = 20000;
  Random random(3);
  for (int i = 0; i < spots; ++i) {
    const Eigen::Vector3f spot(static_cast<float>(random.uniform(-500, 500)),
                               static_cast<float>(random.uniform(-500, 500)), 0.0F);
    const float patch = materials.patch(spot);
    EXPECT_GE(patch, 0.6F);
    EXPECT_LE(patch, 1.4F);
    EXPECT_EQ(patch, materials.patch(spot));
    sum += static_cast<double>(patch);
  }
  EXPECT_NEAR(sum / spots, 1.0, 0.01);
}

TEST(Materials, PanesLoseTheirShareOfBeams) {
  Materials materials = default_materials();
  materials.lost_in_panes = true;
  double lost = 0.0;
  constexpr int spots = 20000;
  Random random(4);
  for (int i = 0; i < spots; ++i) {
    const Eigen::Vector3f spot(static_cast<float>(random.uniform(-500, 500)),
                               static_cast<float>(random.uniform(-500, 500)), 1.0F);
    const float here = materials.at(Surface::window, spot).lost;
    EXPECT_TRUE(here > 0.9F || here < 0.1F) << here;
    lost += static_cast<double>(here);
  }
  EXPECT_NEAR(lost / spots, 0.4 * 0.93 + 0.6 * 0.07, 0.02);
}

}  // namespace
}  // namespace stillmap::simulation
