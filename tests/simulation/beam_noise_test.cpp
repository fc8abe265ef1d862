#include "core/simulation/beam_noise.hpp"

#include <gmock/gmock.h>

namespace stillmap::simulation {
namespace {

struct Statistics {
  double share = 0.0, mean_m = 0.0, sigma_m = 0.0, intensity = 0.0;
};

Statistics fire(const BeamNoise& noise, float range_m, float cos_incidence,
                const SurfaceProperties& surface) {
  constexpr int shots = 20000;
  double count = 0.0, sum = 0.0, squares = 0.0, intensity = 0.0;
  for (int i = 0; i < shots; ++i) {
    Random random(7, static_cast<std::uint64_t>(i));
    const auto seen = beam_return(noise, range_m, cos_incidence, surface, 1.0F, random);
    if (!seen) continue;
    const double error = seen->range_m - range_m;
    count += 1.0;
    sum += error;
    squares += error * error;
    intensity += seen->intensity;
  }
  const double mean = sum / count;
  return {count / shots, mean, std::sqrt(squares / count - mean * mean), intensity / count};
}

constexpr SurfaceProperties grey{50, 0.4F};

TEST(BeamNoise, NearReturnsHaveTheConfiguredNoiseAndLosses) {
  const Statistics near = fire({.range_sigma_m = 0.03, .drop_share = 0.1}, 10.0F, 1.0F, grey);
  EXPECT_NEAR(near.share, 0.9, 0.01);
  EXPECT_NEAR(near.mean_m, 0.0, 0.001);
  EXPECT_NEAR(near.sigma_m, 0.03, 0.001);
}

TEST(BeamNoise, FarDarkAndGrazingSurfacesReturnLess) {
  const BeamNoise noise;
  const double near = fire(noise, 20.0F, 1.0F, grey).share;
  EXPECT_GT(near, 0.97);
  EXPECT_LT(fire(noise, 115.0F, 0.3F, grey).share, 0.9 * near);
  EXPECT_LT(fire(noise, 80.0F, 1.0F, {50, 0.05F}).share, 0.5 * near);
  EXPECT_LT(fire(noise, 60.0F, 0.02F, grey).share, fire(noise, 60.0F, 1.0F, grey).share);
  EXPECT_NEAR(fire(noise, 20.0F, 1.0F, {50, 0.4F, 0.5F}).share, 0.5 * near, 0.02);
}

TEST(BeamNoise, IntensityFollowsReflectivityAngleAndStaysInRange) {
  const BeamNoise noise;
  const double square_on = fire(noise, 20.0F, 1.0F, grey).intensity;
  EXPECT_GT(square_on, fire(noise, 20.0F, 0.3F, grey).intensity);
  EXPECT_GT(square_on, fire(noise, 50.0F, 1.0F, grey).intensity);
  EXPECT_GT(square_on, fire(noise, 20.0F, 1.0F, {50, 0.2F}).intensity);
  EXPECT_LE(fire(noise, 5.0F, 1.0F, {81, 5.0F}).intensity, 1.0);
}

TEST(BeamNoise, SilentNoiseChangesNothing) {
  const BeamNoise none{.range_sigma_m = 0, .drop_share = 0, .intensity_sigma = 0, .min_return = 0};
  const Statistics all = fire(none, 100.0F, 0.01F, grey);
  EXPECT_EQ(all.share, 1.0);
  EXPECT_EQ(all.sigma_m, 0.0);
}

TEST(BeamNoise, NamesItsFaults) {
  const BeamNoise bad{.range_sigma_m = -1.0, .drop_share = 2.0};
  EXPECT_THAT(bad.faults(), testing::AllOf(testing::HasSubstr("range_sigma_m"),
                                           testing::HasSubstr("drop_share")));
  EXPECT_EQ(BeamNoise{}.faults(), "");
}

}  // namespace
}  // namespace stillmap::simulation
