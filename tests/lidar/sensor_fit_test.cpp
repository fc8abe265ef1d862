#include "core/lidar/sensor_fit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace stillmap {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr double degree = std::numbers::pi / 180.0;

void add_point(double elevation, double azimuth, double range_m, Scan& scan) {
  scan.points_lidar.push_back(
      (range_m * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                 std::cos(elevation) * std::sin(azimuth), std::sin(elevation)))
          .cast<float>());
}

/// All beams of a sensor, 200 points each; rings counted from the bottom, as Velodyne's do.
Scan scan_of(const SensorModel& sensor, bool with_rings) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> range_m(2.0, 50.0);
  Scan scan;
  for (int ring = 0; ring < sensor.rings; ++ring) {
    for (int column = 0; column < 200; ++column) {
      add_point(sensor.beam_elevation(ring), 0.0314 * column, range_m(random), scan);
      if (with_rings) scan.ring.push_back(static_cast<std::uint16_t>(sensor.rings - 1 - ring));
    }
  }
  return scan;
}

TEST(FitSensor, FindsTheBuiltInSensorsByTheirRings) {
  for (const SensorModel& sensor : {vlp_16(), hdl_32e(), hdl_64e()}) {
    const auto fitted = fit_sensor(scan_of(sensor, true));
    ASSERT_TRUE(fitted);
    EXPECT_EQ(fitted->name, sensor.name);
  }
  EXPECT_EQ(fit_sensor(scan_of(vlp_16(), false))->name, "VLP-16");
}

TEST(FitSensor, MakesASensorOfTheRingsOfAnUnknownOne) {
  SensorModel ouster;
  ouster.rings = 64;
  ouster.fov_up = 22.5 * degree;
  ouster.fov_down = -22.5 * degree;
  Scan scan = scan_of(ouster, true);
  // One ring saw nothing at all, and points that were not measured lie at the origin.
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (scan.ring[i] == 20) scan.points_lidar[i].setZero();
  }
  const auto fitted = fit_sensor(scan);
  ASSERT_TRUE(fitted);
  EXPECT_THAT(fitted->faults(), IsEmpty());
  ASSERT_EQ(fitted->rings, 64);
  for (int ring = 0; ring < 64; ++ring) {
    EXPECT_NEAR(fitted->beam_elevation(ring), ouster.beam_elevation(ring), 0.01 * degree) << ring;
  }
  EXPECT_THAT(sensor_mismatch(scan, *fitted), IsEmpty());
}

TEST(FitSensor, GivesALidarWithoutRingsBands) {
  // As of a Livox Mid-360: anywhere between -7 and 52 degrees.
  std::mt19937 random(4);
  std::uniform_real_distribution<double> elevation(-7.0 * degree, 52.0 * degree),
      azimuth(-3.1, 3.1);
  Scan scan;
  for (int i = 0; i < 20'000; ++i) add_point(elevation(random), azimuth(random), 9.0, scan);
  const auto fitted = fit_sensor(scan);
  ASSERT_TRUE(fitted);
  EXPECT_THAT(fitted->faults(), IsEmpty());
  EXPECT_EQ(fitted->pattern, ScanPattern::irregular);
  EXPECT_EQ(fitted->rings, 40);
  EXPECT_NEAR(fitted->fov_up, 52.0 * degree, 0.2 * degree);
  EXPECT_NEAR(fitted->fov_down, -7.0 * degree, 0.2 * degree);
}

// As CARLA's by default: its highest ring lies between the two highest beams of an HDL-32E.
TEST(FitSensor, TakesRingsBetweenTheBeamsOfABuiltInSensorForOthers) {
  SensorModel even;
  even.rings = 32;
  even.fov_up = 10.645 * degree;
  even.fov_down = -30.645 * degree;
  const auto fitted = fit_sensor(scan_of(even, false));
  ASSERT_TRUE(fitted);
  EXPECT_NE(fitted->name, "HDL-32E");
  ASSERT_EQ(fitted->rings, 32);
  for (int ring = 0; ring < 32; ++ring)
    EXPECT_NEAR(fitted->beam_elevation(ring), (10.0 - ring * 40.0 / 31.0) * degree, 0.02 * degree);
  // A lidar that leans by a quarter of a degree is itself.
  SensorModel leaning = hdl_32e();
  leaning.fov_up += 0.25 * degree;
  leaning.fov_down += 0.25 * degree;
  for (double& beam : leaning.beam_elevations) beam += 0.25 * degree;
  EXPECT_EQ(fit_sensor(scan_of(leaning, false))->name, "HDL-32E");
}

TEST(FitSensor, FindsRingsThatAScanDoesNotNumber) {
  SensorModel uneven;
  uneven.rings = 20;
  uneven.fov_up = 15.0 * degree;
  uneven.fov_down = -25.0 * degree;
  for (int ring = 0; ring < 20; ++ring)
    uneven.beam_elevations.push_back((14.0 - ring - 0.04 * ring * ring) * degree);
  for (const SensorModel& sensor : {hdl_32e(), uneven}) {
    Scan scan = scan_of(sensor, false);
    // Beams that start beside the origin, and some points of mixed returns between.
    for (std::size_t i = 0; i < scan.size(); ++i)
      scan.points_lidar[i].z() += 0.005F * static_cast<float>(static_cast<int>(i / 200 % 3) - 1);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> elevation(-24.0 * degree, 9.0 * degree);
    const std::size_t mixed = scan.size() / 50;
    for (std::size_t i = 0; i < mixed; ++i) add_point(elevation(random), 1.0, 9.0, scan);
    const auto fitted = fit_sensor(scan);
    ASSERT_TRUE(fitted);
    EXPECT_THAT(fitted->faults(), IsEmpty());
    EXPECT_EQ(fitted->pattern, ScanPattern::rings);
    ASSERT_EQ(fitted->rings, sensor.rings);
    for (int ring = 0; ring < sensor.rings; ++ring)
      EXPECT_NEAR(fitted->beam_elevation(ring), sensor.beam_elevation(ring), 0.1 * degree) << ring;
  }
  EXPECT_EQ(fit_sensor(scan_of(hdl_32e(), false))->name, "HDL-32E");
}

TEST(FitSensor, TellsRingsByTheOrderOfPointsWhereBeamsStartApart) {
  // Every fourth beam of KITTI's lidar, say: as high and low as all, and each as wide as a step.
  SensorModel sensor = hdl_64e();
  sensor.rings = 16;
  for (std::size_t ring = 0; ring < 16; ++ring)
    sensor.beam_elevations[ring] = hdl_64e().beam_elevations[4 * ring];
  sensor.beam_elevations.resize(16);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> range_m(4.0, 50.0);
  Scan scan;
  for (int ring = 0; ring < sensor.rings; ++ring) {
    for (int column = 0; column < 500; ++column) {
      add_point(sensor.beam_elevation(ring), 0.01256 * column, range_m(random), scan);
      scan.points_lidar.back().z() += ring < 8 ? 0.1F : -0.1F;
      // What was not measured.
      if (column % 7 == 0) scan.points_lidar.back().setZero();
    }
  }
  const auto fitted = fit_sensor(scan);
  ASSERT_TRUE(fitted);
  EXPECT_EQ(fitted->pattern, ScanPattern::rings);
  EXPECT_EQ(fitted->ring_source, RingSource::order);
  ASSERT_EQ(fitted->rings, 16);
  for (int ring = 0; ring < 16; ++ring)
    EXPECT_NEAR(fitted->beam_elevation(ring), sensor.beam_elevation(ring), 0.5 * degree) << ring;
  std::ranges::shuffle(scan.points_lidar, random);
  EXPECT_EQ(fit_sensor(scan)->name, "HDL-64E") << "by its field of view, as without an order";
}

TEST(FitSensor, TakesNoPatternWithoutRingsForRings) {
  for (const int points : {1'200, 3'000, 10'000, 100'000}) {
    std::mt19937 random(static_cast<unsigned>(points));
    std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi);
    Scan uniform, rosette, lines;
    for (int i = 0; i < points; ++i) {
      const double a = phase(random), b = phase(random);
      add_point((a * 18.0 - 50.0) * degree, b, 9.0, uniform);
      // Points of a rosette crowd at its edges.
      add_point(35.0 * std::sin(a) * std::cos(b) * degree, 0.6 * std::sin(a) * std::sin(b), 9.0,
                rosette);
      // Eight lines that each sweep over a tenth of the field of view.
      add_point((-20.0 + 5.0 * (i % 8) + 4.0 * std::sin(b)) * degree, b, 9.0, lines);
    }
    for (const Scan& scan : {uniform, rosette, lines})
      EXPECT_EQ(fit_sensor(scan)->pattern, ScanPattern::irregular) << points;
  }
}

TEST(FitSensor, MakesNothingOfNothing) {
  EXPECT_FALSE(fit_sensor({}));
  Scan scan;
  for (int i = 0; i < 5000; ++i) scan.points_lidar.emplace_back(NAN, 1.0F, INFINITY);
  EXPECT_FALSE(fit_sensor(scan));
  for (auto& p : scan.points_lidar) p.setZero();
  scan.ring.assign(scan.size(), 65535);
  EXPECT_FALSE(fit_sensor(scan));
  for (auto& p : scan.points_lidar) p = {5.0F, 1.0F, 0.0F};
  EXPECT_FALSE(fit_sensor(scan));
}

/// Without the highest rings, as where they look into the sky.
Scan lower_rings_of(const SensorModel& sensor, int missing) {
  Scan scan = scan_of(sensor, true);
  const auto cut = 200 * static_cast<std::ptrdiff_t>(missing);
  scan.points_lidar.erase(scan.points_lidar.begin(), scan.points_lidar.begin() + cut);
  scan.ring.erase(scan.ring.begin(), scan.ring.begin() + cut);
  return scan;
}

TEST(FitSensor, KnowsABuiltInSensorOfWhichSomeRingsSawNothing) {
  EXPECT_EQ(fit_sensor(lower_rings_of(vlp_16(), 4))->name, "VLP-16");
  EXPECT_EQ(fit_sensor(lower_rings_of(hdl_64e(), 10))->name, "HDL-64E");
  EXPECT_EQ(fit_sensor(lower_rings_of(vlp_16(), 5))->rings, 11);
  // Rings 4/3 degrees apart are those of a HDL-32E, but half of them are missing.
  SensorModel high_resolution;
  high_resolution.rings = 16;
  high_resolution.fov_up = 32.0 / 3.0 * degree;
  high_resolution.fov_down = -32.0 / 3.0 * degree;
  EXPECT_THAT(fit_sensor(scan_of(high_resolution, true))->name, HasSubstr("16 rings"));
}

/// With other numbers in the ring field.
template <class Number>
Scan renumbered(Scan scan, Number number) {
  for (std::uint16_t& ring : scan.ring) ring = static_cast<std::uint16_t>(number(ring));
  return scan;
}

TEST(FitSensor, CountsNoRingThatTheFieldDoesNotHave) {
  SensorModel ouster;
  ouster.rings = 32;
  ouster.fov_up = 22.5 * degree;
  ouster.fov_down = -22.5 * degree;
  const auto from_one = [](int ring) { return ring + 1; };
  const auto every_fourth = [](int ring) { return 4 * ring + 3; };
  const Scan counted_from_one = renumbered(scan_of(ouster, true), from_one);
  const Scan skipping = renumbered(scan_of(ouster, true), every_fourth);
  for (const Scan& scan : {counted_from_one, skipping}) {
    const auto fitted = fit_sensor(scan);
    ASSERT_TRUE(fitted);
    ASSERT_EQ(fitted->rings, 32);
    for (int ring = 0; ring < 32; ++ring)
      EXPECT_NEAR(fitted->beam_elevation(ring), ouster.beam_elevation(ring), 0.01 * degree) << ring;
    EXPECT_THAT(sensor_mismatch(scan, *fitted), IsEmpty());
  }
  EXPECT_EQ(fit_sensor(renumbered(scan_of(vlp_16(), true), from_one))->name, "VLP-16");
}

TEST(FitSensor, CountsRingsThatStandInTheFieldWithoutAPoint) {
  SensorModel ouster;
  ouster.rings = 32;
  ouster.fov_up = 22.5 * degree;
  ouster.fov_down = -22.5 * degree;
  Scan scan = scan_of(ouster, true);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (scan.ring[i] < 2 || scan.ring[i] > 26) scan.points_lidar[i].setZero();
  }
  EXPECT_EQ(fit_sensor(scan)->rings, 32);
}

TEST(SensorRecognition, TakesTheFirstScanOfEnoughPoints) {
  SensorRecognition recognition;
  Scan few = scan_of(vlp_16(), true);
  few.points_lidar.resize(900);
  few.ring.resize(900);
  EXPECT_FALSE(recognition.learn({}));
  EXPECT_FALSE(recognition.learn(few));
  EXPECT_EQ(recognition.sensor(), nullptr);
  EXPECT_TRUE(recognition.learn(scan_of(vlp_16(), true)));
  EXPECT_EQ(recognition.sensor()->name, "VLP-16");
  EXPECT_FALSE(recognition.learn(scan_of(vlp_16(), true)));
  EXPECT_EQ(in_words(*recognition.sensor()),
            "VLP-16: 16 rings from 16.00 to -16.00 degrees of elevation");
}

TEST(SensorRecognition, LearnsOfMoreRingsAndAWiderFieldOfView) {
  SensorModel ouster;
  ouster.rings = 64;
  ouster.fov_up = 22.5 * degree;
  ouster.fov_down = -22.5 * degree;
  SensorRecognition of_rings;
  EXPECT_TRUE(of_rings.learn(lower_rings_of(ouster, 20)));
  EXPECT_EQ(of_rings.sensor()->rings, 44);
  EXPECT_TRUE(of_rings.learn(scan_of(ouster, true)));
  EXPECT_EQ(of_rings.sensor()->rings, 64);
  // Another lidar's.
  EXPECT_FALSE(of_rings.learn(scan_of(vlp_16(), true)));
  EXPECT_EQ(of_rings.sensor()->rings, 64);

  const auto points_between = [](double low, double high) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> elevation(low * degree, high * degree),
        azimuth(-3.1, 3.1);
    Scan scan;
    for (int i = 0; i < 20'000; ++i) add_point(elevation(random), azimuth(random), 9.0, scan);
    return scan;
  };
  SensorRecognition without_rings;
  EXPECT_TRUE(without_rings.learn(points_between(-7.0, 20.0)));
  EXPECT_TRUE(without_rings.learn(points_between(0.0, 52.0)));
  EXPECT_NEAR(without_rings.sensor()->fov_up, 52.0 * degree, 0.2 * degree);
  EXPECT_NEAR(without_rings.sensor()->fov_down, -7.0 * degree, 0.2 * degree);
  EXPECT_EQ(in_words(*without_rings.sensor()).find("lidar without rings: points anywhere from 5"),
            0U);
}

TEST(SensorRecognition, TellsALidarNumberedFromTheTopOnceThoughItsHighestRingsSawNothing) {
  SensorModel wide;
  wide.rings = 64;
  wide.fov_up = 45.0 * degree;
  wide.fov_down = -45.0 * degree;
  const auto from_top = [](int ring) { return 63 - ring; };
  SensorRecognition recognition;
  int times_told = 0;
  for (const int missing : {9, 8, 6, 4, 2, 0})
    times_told += recognition.learn(renumbered(lower_rings_of(wide, missing), from_top)) ? 1 : 0;
  EXPECT_EQ(times_told, 1);
  ASSERT_EQ(recognition.sensor()->rings, 64);
  for (int ring = 0; ring < 64; ++ring)
    EXPECT_NEAR(recognition.sensor()->beam_elevation(ring), wide.beam_elevation(ring),
                0.05 * degree);
}

TEST(SensorMismatch, NamesWhatDoesNotFit) {
  SensorModel wide;
  wide.rings = 128;
  wide.fov_up = 45.0 * degree;
  wide.fov_down = -45.0 * degree;
  EXPECT_THAT(sensor_mismatch(scan_of(wide, true), hdl_64e()), HasSubstr("ring field reaches 127"));
  EXPECT_THAT(sensor_mismatch(scan_of(wide, false), hdl_64e()), HasSubstr("between -4"));
  EXPECT_THAT(sensor_mismatch(scan_of(hdl_64e(), true), hdl_64e()), IsEmpty());
  EXPECT_THAT(sensor_mismatch({}, hdl_64e()), IsEmpty());
}

TEST(FitSensor, TakesNoPointAtInfinityForMeasured) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const bool with_rings : {true, false}) {
    for (const SensorModel& sensor : {vlp_16(), hdl_32e(), hdl_64e()}) {
      Scan scan = scan_of(sensor, with_rings);
      // What the upper half of the beams did not hit, as Gazebo and REP 117 write it.
      for (int ring = 0; ring < sensor.rings / 2; ++ring) {
        for (int column = 0; column < 400; ++column) {
          add_point(sensor.beam_elevation(ring), 0.0157 * column + 0.005, infinity, scan);
          if (with_rings) scan.ring.push_back(static_cast<std::uint16_t>(sensor.rings - 1 - ring));
        }
      }
      EXPECT_EQ(fit_sensor(scan)->name, sensor.name) << with_rings;
      EXPECT_THAT(sensor_mismatch(scan, sensor), IsEmpty()) << with_rings;
    }
  }
}

/// Turned about y, as by a lidar's pitch.
Scan pitched(Scan scan, double angle) {
  const Eigen::Matrix3f R =
      Eigen::AngleAxisf(static_cast<float>(angle), Eigen::Vector3f::UnitY()).toRotationMatrix();
  for (Eigen::Vector3f& p : scan.points_lidar) p = R * p;
  return scan;
}

/// Two lidars in one cloud, one of which leans forwards and the other backwards.
Scan leaning_pair(const SensorModel& sensor, double angle) {
  Scan scan = pitched(scan_of(sensor, true), angle);
  const Scan other = pitched(scan_of(sensor, true), -angle);
  scan.points_lidar.insert(scan.points_lidar.end(), other.points_lidar.begin(),
                           other.points_lidar.end());
  scan.ring.insert(scan.ring.end(), other.ring.begin(), other.ring.end());
  return scan;
}

TEST(FitSensor, LeavesOutARingFieldThatNamesNoRings) {
  SensorModel wide;
  wide.rings = 128;
  wide.fov_up = 45.0 * degree;
  wide.fov_down = -45.0 * degree;
  for (const SensorModel& sensor : {vlp_16(), hdl_32e(), wide}) {
    for (const double angle : {8.0, 20.0, 45.0}) {
      const Scan scan = leaning_pair(sensor, angle * degree);
      const auto fitted = fit_sensor(scan);
      ASSERT_TRUE(fitted);
      EXPECT_EQ(fitted->pattern, ScanPattern::irregular) << sensor.name << " by " << angle;
      EXPECT_THAT(sensor_mismatch(scan, *fitted), IsEmpty());
      EXPECT_GT(fitted->fov_up, sensor.beam_elevation(0));
    }
  }
  // Numbers by azimuth, and by nothing.
  Scan scan = scan_of(hdl_32e(), true);
  std::mt19937 random(6);
  for (std::size_t i = 0; i < scan.size(); ++i) scan.ring[i] = static_cast<std::uint16_t>(i % 200);
  EXPECT_EQ(fit_sensor(scan)->name, "HDL-32E");
  for (std::uint16_t& ring : scan.ring) ring = static_cast<std::uint16_t>(random() % 64);
  EXPECT_EQ(fit_sensor(scan)->name, "HDL-32E");
}

/// Above the robot's origin, beside a wall: rings go up and down by degrees, but smoothly.
TEST(FitSensor, BelievesTheRingsOfACloudInTheFrameOfTheRobot) {
  const SensorModel sensor = vlp_16();
  Scan scan;
  for (int ring = 0; ring < sensor.rings; ++ring) {
    for (int column = 0; column < 720; ++column) {
      const double azimuth = 0.5 * column * degree, up = sensor.beam_elevation(ring);
      const Eigen::Vector3d ray(std::cos(up) * std::cos(azimuth), std::cos(up) * std::sin(azimuth),
                                std::sin(up));
      const Eigen::Array3d wall(ray.x() > 0.0 ? 1.5 : -4.5, ray.y() > 0.0 ? 2.0 : -6.0,
                                ray.z() > 0.0 ? 2.0 : -1.0);
      const double range_m = (wall / ray.array()).minCoeff();
      scan.points_lidar.push_back((range_m * ray + Eigen::Vector3d(0.0, 0.0, 1.0)).cast<float>());
      scan.ring.push_back(static_cast<std::uint16_t>(ring));
    }
  }
  const auto fitted = fit_sensor(scan);
  ASSERT_TRUE(fitted);
  EXPECT_EQ(fitted->pattern, ScanPattern::rings);
  EXPECT_EQ(fitted->rings, sensor.rings);
}

TEST(FitSensor, BelievesTheRingsOfACompensatedScan) {
  // To the end of a sweep: 3 m on, as of a car on a motorway, or 10 degrees down, of a hand.
  for (const SensorModel& sensor : {vlp_16(), hdl_32e(), hdl_64e()}) {
    Scan driven = scan_of(sensor, true), nodded = driven;
    for (std::size_t i = 0; i < driven.size(); ++i) {
      const double part = static_cast<double>(i % 200) / 200.0;
      driven.points_lidar[i].x() -= static_cast<float>(3.0 * part);
      nodded.points_lidar[i] =
          Eigen::AngleAxisf(static_cast<float>(10.0 * degree * part), Eigen::Vector3f::UnitY()) *
          nodded.points_lidar[i];
    }
    EXPECT_EQ(fit_sensor(driven)->pattern, ScanPattern::rings) << sensor.name;
    EXPECT_EQ(fit_sensor(driven)->rings, sensor.rings);
    EXPECT_EQ(fit_sensor(nodded)->rings, sensor.rings);
  }
}

TEST(FitSensor, TakesTheNumberOfPointsThatWereNotMeasuredForNoRing) {
  SensorModel ouster;
  ouster.rings = 64;
  ouster.fov_up = 22.5 * degree;
  ouster.fov_down = -22.5 * degree;
  for (const int no_ring : {255, 65535}) {
    for (const SensorModel& sensor : {vlp_16(), ouster}) {
      Scan scan = scan_of(sensor, true);
      for (std::size_t i = 0; i < scan.size(); i += 3) {
        scan.points_lidar[i].setConstant(NAN);
        scan.ring[i] = static_cast<std::uint16_t>(no_ring);
      }
      const auto fitted = fit_sensor(scan);
      EXPECT_EQ(fitted->rings, sensor.rings) << no_ring;
      EXPECT_NEAR(fitted->beam_elevation(0), sensor.beam_elevation(0), 0.01 * degree);
      EXPECT_THAT(sensor_mismatch(scan, sensor), IsEmpty());
    }
  }
  // Of a lidar whose rings reach up to it, it is one that saw nothing.
  SensorModel fine = ouster;
  fine.rings = 256;
  Scan scan = scan_of(fine, true);
  for (std::size_t i = 0; i < scan.size(); ++i)
    if (scan.ring[i] == 255) scan.points_lidar[i].setZero();
  EXPECT_EQ(fit_sensor(scan)->rings, 256);
}

}  // namespace
}  // namespace stillmap
