#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "core/lidar/angle_units.hpp"
#include "core/lidar/prepare.hpp"
#include "core/localization/lone_scan.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/localization/yard_map.hpp"

namespace stillmap::test {
namespace {

struct PoseOff {
  double metres = 0.0;
  double degrees = 0.0;
};

PoseOff off(const Eigen::Isometry3d& T_true, const Eigen::Isometry3d& T) {
  const Eigen::Isometry3d difference = T_true.inverse() * T;
  return {difference.translation().norm(),
          deg_per_rad * Eigen::AngleAxisd(difference.linear()).angle()};
}

// On a slope the ground round a place of the path is tilted against that below the lidar, and the
// search begins so. What stands up hardly tells 16 rings how they are tilted.
TEST(MisledScan, IsRegisteredUprightWhereTheGroundTiltedIt) {
  const Localizer localizer(index_of(first_yard()));
  const simulation::Simulation simulation(yard(1, 1));
  for (int k = 5; k < 240; k += 29) {
    const simulation::SimulatedScan simulated = simulation.scan(k);
    const Scan scan = drop_unusable_points(simulated.scan, PrepareConfig{});
    const LocalizationQuery query(scan, labels_of(scan), Eigen::Matrix3d::Identity());
    for (const double tilt_deg : {-8.0, 8.0}) {
      for (const Eigen::Vector3d& axis :
           {Eigen::Vector3d(Eigen::Vector3d::UnitX()), Eigen::Vector3d(Eigen::Vector3d::UnitY())}) {
        SCOPED_TRACE(std::to_string(k) + " tilted by " + std::to_string(tilt_deg) + " about " +
                     (axis.x() > 0.0 ? "x" : "y"));
        const Eigen::Isometry3d T_start = simulated.T_map_lidar * Eigen::Translation3d(0, 0, -0.8) *
                                          Eigen::AngleAxisd(tilt_deg * rad_per_deg, axis);
        const PlaceHypothesis place = localizer.align_at(query, T_start);
        if (place.may_slide || !is_believed(place.evidence, localizer.config())) continue;
        const PoseOff error = off(simulated.T_map_lidar, place.T_map_lidar);
        EXPECT_LT(error.metres, 0.5);
        EXPECT_LT(error.degrees, 2.0);
      }
    }
  }
}

// Of a lidar that turns by up to 12 degrees while a scan of five a second is measured.
TEST(MisledScan, ThatTurnedWithoutAnotherBesideItIsRightOrAmbiguous) {
  simulation::SimulationConfig config = yard(1, 1);
  config.rolling = true;
  config.motion = simulation::LidarMotion::hard_turns;
  config.sensor.period_s = 0.2;
  config.scans = 120;
  const Localizer localizer(index_of(first_yard()));
  const simulation::Simulation simulation(config);
  int found = 0;
  for (int k = 3; k < 120; k += 18) {
    SCOPED_TRACE(k);
    const simulation::SimulatedScan simulated = simulation.scan(k);
    const Scan scan = drop_unusable_points(simulated.scan, PrepareConfig{});
    const StampedLocalization lone = localize_lone_scan(
        localizer, scan, labels_of(scan), Eigen::Matrix3d::Identity(), config.sensor.period_s);
    if (lone.result.status != LocalizationStatus::found) continue;
    ++found;
    const PoseOff error = off(simulated.T_map_lidar, lone.result.places.front().T_map_lidar);
    EXPECT_LT(error.metres, 0.5) << name(lone.motion);
    EXPECT_LT(error.degrees, 2.0) << name(lone.motion);
  }
  EXPECT_GE(found, 4);
}

// A blow turns the lidar amid its sweep: no steady motion explains the scan, and its stamp may be
// before the blow or after it.
TEST(MisledScan, ThatBendsByNoSteadyMotionIsAmbiguousThoughItWasFound) {
  constexpr double duration_s = 0.1, part_before = 0.5, turn_deg = 12.0;
  const Localizer localizer(index_of(first_yard()));
  Scan scan =
      drop_unusable_points(simulation::Simulation(yard(1, 1)).scan(69).scan, PrepareConfig{});
  const Eigen::Matrix3f R_before_after =
      Eigen::AngleAxisd(turn_deg * rad_per_deg, Eigen::Vector3d::UnitZ())
          .toRotationMatrix()
          .cast<float>();
  scan.time_offset_s.clear();
  for (Eigen::Vector3f& p : scan.points_lidar) {
    const double part = 0.5 + std::atan2(p.y(), p.x()) / (2.0 * std::numbers::pi);
    scan.time_offset_s.push_back(static_cast<float>(duration_s * (part - 0.5)));
    if (part > part_before) p = R_before_after * p;
  }
  const PointLabels labels = labels_of(scan);
  const Eigen::Matrix3d R_body_lidar = Eigen::Matrix3d::Identity();
  const StampedLocalization lone =
      localize_lone_scan(localizer, scan, labels, R_body_lidar, duration_s);
  EXPECT_EQ(lone.motion, SweepMotionSource::unknown);
  EXPECT_EQ(lone.result.status, LocalizationStatus::ambiguous);
}

}  // namespace
}  // namespace stillmap::test
