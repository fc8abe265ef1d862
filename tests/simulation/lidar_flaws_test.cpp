#include "core/simulation/lidar_flaws.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "core/simulation/simulation.hpp"

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

TEST(BeamNoise, GlossDarkensWhatIsSeenAskewAndLosesNoBeams) {
  SurfaceProperties glossy = grey;
  glossy.gloss = 4.0F;
  const BeamNoise noise;
  EXPECT_DOUBLE_EQ(fire(noise, 20.0F, 1.0F, glossy).intensity,
                   fire(noise, 20.0F, 1.0F, grey).intensity);
  const Statistics rough = fire(noise, 20.0F, 0.5F, grey);
  const Statistics smooth = fire(noise, 20.0F, 0.5F, glossy);
  EXPECT_NEAR(smooth.intensity, rough.intensity / 16.0, 0.01);
  EXPECT_EQ(smooth.share, rough.share);
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

SimulationConfig clean_yard() {
  SimulationConfig config;
  config.plan = test_yard();
  config.sensor = vlp_16();
  config.scans = 3;
  config.noise = {.range_sigma_m = 0, .drop_share = 0, .intensity_sigma = 0, .min_return = 0};
  return config;
}

TEST(LidarFlaws, NoneChangeNothing) {
  const LidarFlaws none;
  EXPECT_EQ(none.beam(5).gain, 1.0);
  EXPECT_FALSE(none.is_blind(1.0, -0.2, 5));
  for (const float intensity : {0.0F, 0.3F, 1.0F}) {
    EXPECT_FLOAT_EQ(none.reported_intensity(intensity, 5), intensity);
  }
}

TEST(LidarFlaws, BeamErrorsTiltTheBeams) {
  SimulationConfig config = clean_yard();
  config.flaws.beams.assign(16, {});
  config.flaws.beams[15].elevation_error = 0.02;
  const Scan scan = Simulation(config).scan(0).scan;
  ASSERT_GT(std::ranges::count(scan.ring, 15), 10);
  ASSERT_GT(std::ranges::count(scan.ring, 14), 10);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const Eigen::Vector3f& p = scan.points_lidar[i];
    const double error = scan.ring[i] == 15 ? 0.02 : 0.0;
    EXPECT_NEAR(std::atan2(p.z(), p.head<2>().norm()),
                config.sensor.beam_elevation(scan.ring[i]) + error, 1e-4);
  }
}

TEST(LidarFlaws, RaisedBeamsSeeTheSameGround) {
  SimulationConfig config = clean_yard();
  const auto lowest = [](const SimulatedScan& out) {
    double sum = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < out.scan.size(); ++i) {
      if (out.scan.labels[i] != SemanticClass::road || out.scan.ring[i] != 15) continue;
      sum += static_cast<double>(out.scan.points_lidar[i].z());
      ++count;
    }
    return sum / count;
  };
  const double plain = lowest(Simulation(config).scan(0));
  config.flaws.beams.assign(16, {.height_m = 0.2});
  EXPECT_NEAR(lowest(Simulation(config).scan(0)), plain, 0.03);
}

TEST(LidarFlaws, BlindSpotsAreEmptyAndTheRestIsNot) {
  SimulationConfig config = clean_yard();
  config.flaws.blind_spots = {
      {.azimuth = 1.0, .elevation = -0.2, .half_width = 0.4, .half_height = 0.1}};
  const Scan scan = Simulation(config).scan(0).scan;
  int inside = 0, beside = 0;
  for (const Eigen::Vector3f& p : scan.points_lidar) {
    const double elevation = std::atan2(p.z(), p.head<2>().norm());
    if (std::abs(elevation + 0.2) > 0.03) continue;
    const double azimuth = std::atan2(p.y(), p.x());
    inside += std::abs(azimuth - 1.0) < 0.25 ? 1 : 0;
    beside += std::abs(azimuth + 1.0) < 0.25 ? 1 : 0;
  }
  EXPECT_EQ(inside, 0);
  EXPECT_GT(beside, 50);
}

TEST(LidarFlaws, IntensityIsMappedAndRounded) {
  LidarFlaws flaws;
  flaws.intensity_gain = 0.5;
  flaws.intensity_gamma = 2.0;
  flaws.intensity_offset = 0.1;
  EXPECT_FLOAT_EQ(flaws.reported_intensity(0.4F, 0), 0.18F);
  flaws.intensity_step = 0.05;
  EXPECT_FLOAT_EQ(flaws.reported_intensity(0.4F, 0), 0.2F);
  flaws.intensity_offset = -0.5;
  EXPECT_EQ(flaws.reported_intensity(0.4F, 0), 0.0F);
}

TEST(LidarFlaws, WhatIsDarkerThanTheFloorIsReportedAsZero) {
  LidarFlaws flaws;
  flaws.intensity_gamma = 0.2;
  flaws.intensity_floor = 0.03;
  EXPECT_EQ(flaws.reported_intensity(0.029F, 0), 0.0F);
  EXPECT_GT(flaws.reported_intensity(0.031F, 0), 0.4F);
}

TEST(LidarFlaws, MixedReturnsLieBetweenTheSurfaces) {
  SimulationConfig config = clean_yard();
  const SimulatedScan clean = Simulation(config).scan(0);
  config.flaws.mixed_share = 1.0;
  const SimulatedScan mixed = Simulation(config).scan(0);
  ASSERT_EQ(mixed.scan.size(), clean.scan.size());
  int changed = 0;
  for (std::size_t i = 0; i + 1 < clean.scan.size(); ++i) {
    const float before = clean.scan.points_lidar[i].norm();
    const float now = mixed.scan.points_lidar[i].norm();
    if (std::abs(now - before) < 1e-3F) continue;
    const float next = clean.scan.points_lidar[i + 1].norm();
    EXPECT_GE(now, std::min(before, next) - 1e-3F);
    EXPECT_LE(now, std::max(before, next) + 1e-3F);
    ++changed;
  }
  EXPECT_GT(changed, 50);
}

TEST(LidarFlaws, DrawnOnesFitTheirSensor) {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    for (const SensorModel& sensor : {hdl_64e(), hdl_32e(), vlp_16()}) {
      const LidarFlaws flaws = random_flaws(sensor, Random(seed));
      EXPECT_EQ(flaws.faults(sensor), "");
      EXPECT_EQ(flaws.beams.size(), static_cast<std::size_t>(sensor.rings));
    }
  }
}

TEST(LidarFlaws, NamesItsFaults) {
  SimulationConfig config = clean_yard();
  config.flaws.beams.assign(3, {});
  config.flaws.mixed_share = 2.0;
  config.flaws.intensity_gain = 0.0;
  config.flaws.intensity_floor = -0.1;
  const std::string faults = config.faults();
  for (const char* field : {"beams", "mixed_share", "intensity_gain", "intensity_floor"}) {
    EXPECT_THAT(faults, testing::HasSubstr(field));
  }
}

}  // namespace
}  // namespace stillmap::simulation
