#include "core/odometry/odometry_config.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "core/odometry/odometry.hpp"

namespace stillmap {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

struct FaultCase {
  const char* field;
  std::function<void(OdometryConfig&)> spoil;
};

void PrintTo(const FaultCase& fault, std::ostream* out) { *out << fault.field; }

class OdometryConfigFault : public ::testing::TestWithParam<FaultCase> {};

TEST_P(OdometryConfigFault, IsNamedByTheConstructor) {
  OdometryConfig config;
  GetParam().spoil(config);
  EXPECT_THAT([&] { Odometry(config, hdl_64e()); },
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr(GetParam().field), HasSubstr("must be"))));
}

using C = OdometryConfig;
INSTANTIATE_TEST_SUITE_P(
    EveryField, OdometryConfigFault,
    ::testing::Values(
        FaultCase{"alpha", [](C& c) { c.alpha = 1.1; }},
        FaultCase{"alpha", [](C& c) { c.alpha = std::nan(""); }},
        FaultCase{"features.edge_curvature_m2", [](C& c) { c.features.edge_curvature_m2 = 0.0; }},
        FaultCase{"features.plane_curvature_m2",
                  [](C& c) { c.features.plane_curvature_m2 = -1.0; }},
        FaultCase{"features.edges_per_sector", [](C& c) { c.features.edges_per_sector = -1; }},
        FaultCase{"features.edge_spacing_m", [](C& c) { c.features.edge_spacing_m = 0.0; }},
        FaultCase{"features.map_plane_spacing_m",
                  [](C& c) { c.features.map_plane_spacing_m = 0.0; }},
        FaultCase{"features.plane_spacing_m", [](C& c) { c.features.plane_spacing_m = 0.0; }},
        FaultCase{"local_map.voxel_size_m", [](C& c) { c.local_map.voxel_size_m = 0.0; }},
        FaultCase{"local_map.max_points_per_voxel",
                  [](C& c) { c.local_map.max_points_per_voxel = 33; }},
        FaultCase{"local_map.min_spacing_m", [](C& c) { c.local_map.min_spacing_m = -0.1; }},
        FaultCase{"local_map.radius_m", [](C& c) { c.local_map.radius_m = 0.0; }},
        FaultCase{"registration.neighbours", [](C& c) { c.registration.neighbours = 4; }},
        FaultCase{"registration.neighbours", [](C& c) { c.registration.neighbours = 17; }},
        FaultCase{"registration.max_neighbour_distance_m",
                  [](C& c) { c.registration.max_neighbour_distance_m = 1.5; }},
        FaultCase{"registration.max_residual_m", [](C& c) { c.registration.max_residual_m = 1.5; }},
        FaultCase{"registration.max_iterations", [](C& c) { c.registration.max_iterations = 0; }},
        FaultCase{"registration.robust_scale_m",
                  [](C& c) { c.registration.robust_scale_m = -1.0; }},
        FaultCase{"registration.min_correspondences",
                  [](C& c) { c.registration.min_correspondences = 5; }},
        FaultCase{"registration.sweep_tilt_rad", [](C& c) { c.registration.sweep_tilt_rad = 0.0; }},
        FaultCase{"registration.sweep_bend_rad",
                  [](C& c) { c.registration.sweep_bend_rad = -0.1; }},
        FaultCase{"registration.plane_deviation_m",
                  [](C& c) { c.registration.plane_deviation_m = -0.1; }},
        FaultCase{"registration.sparse_ring_plane_deviation_m",
                  [](C& c) { c.registration.sparse_ring_plane_deviation_m = -0.1; }},
        FaultCase{"registration.max_extrapolation",
                  [](C& c) { c.registration.max_extrapolation = -1.0; }},
        FaultCase{"registration.across_rings_weight",
                  [](C& c) { c.registration.across_rings_weight = 1.5; }},
        FaultCase{"registration.min_observability",
                  [](C& c) { c.registration.min_observability = 1.0; }},
        FaultCase{"motion.inconsistency_threshold",
                  [](C& c) { c.motion.inconsistency_threshold = 2.0; }},
        FaultCase{"motion.range_image_history_size",
                  [](C& c) { c.motion.range_image_history_size = 0; }},
        FaultCase{"motion.range_image_history_interval",
                  [](C& c) { c.motion.range_image_history_interval = 0; }},
        FaultCase{"motion.moving_share", [](C& c) { c.motion.moving_share = 0.0; }},
        FaultCase{"motion.object_gap_m", [](C& c) { c.motion.object_gap_m = 0.0; }}));

TEST(OdometryConfig, DefaultsHaveNoFaults) { EXPECT_EQ(OdometryConfig{}.faults(), ""); }

TEST(OdometryConfig, AllFaultsAreListedOneALine) {
  OdometryConfig config;
  config.alpha = -1.0;
  config.motion.range_image_history_size = 0;
  const std::string faults = config.faults();
  EXPECT_THAT(faults,
              AllOf(HasSubstr("alpha = -1"), HasSubstr("motion.range_image_history_size = 0")));
  EXPECT_EQ(std::ranges::count(faults, '\n'), 2);
}

TEST(OdometryConfig, BeginsAMapWithTheKernelUnlessTheMethodIsThePapers) {
  OdometryConfig none;
  none.weighting = Weighting::none;
  EXPECT_EQ(none.with_method().registration.robust_scale_m, 0.0);
  EXPECT_EQ(none.with_method().registration.plane_deviation_m, 0.0);
  EXPECT_EQ(none.with_method().registration.sparse_ring_plane_deviation_m, 0.0);
  EXPECT_GT(OdometryConfig{}.with_method().registration.plane_deviation_m, 0.0);
  EXPECT_EQ(none.at_start().registration.robust_scale_m, none.registration.robust_scale_m);
  EXPECT_EQ(none.at_start().at_start().registration.robust_scale_m,
            none.registration.robust_scale_m)
      << "a map that is begun again";
  none.paper_exact = true;
  EXPECT_EQ(none.at_start().registration.robust_scale_m, 0.0);
}

}  // namespace
}  // namespace stillmap
