#include "core/segmentation/model_description.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/segmentation/network_segmenter.hpp"
#include "tests/segmentation/onnx_builder.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

constexpr double degree = std::numbers::pi / 180.0;

SensorModel even_beams(int rings) {
  SensorModel sensor;
  sensor.rings = rings;
  sensor.fov_up = 16.0 * degree;
  sensor.fov_down = -26.0 * degree;
  return sensor;
}

int rows_for(const SensorModel& sensor) {
  ModelDescription model = test::describe_family(64, 1024, 20);
  model.follow_sensor = true;
  return for_sensor(model, sensor).rows;
}

TEST(ForSensor, GivesOnlyAModelThatFollowsTheSensorsFieldOfView) {
  ModelDescription model = test::describe_family(64, 1024, 20);
  EXPECT_EQ(for_sensor(model, vlp_16()).rows, 64);
  model.follow_sensor = true;
  const ModelDescription fitted = for_sensor(model, vlp_16());
  EXPECT_EQ(fitted.rows, 32);
  EXPECT_EQ(fitted.columns, 1024);
  EXPECT_EQ(fitted.fov_up, vlp_16().fov_up);
  EXPECT_EQ(fitted.fov_down, vlp_16().fov_down);
}

TEST(ForSensor, GivesRowsHalfWayBetweenBeamsAndTheModelsButNoMoreThanTwiceTheBeams) {
  EXPECT_EQ(rows_for(even_beams(16)), 32);
  EXPECT_EQ(rows_for(even_beams(20)), 40);
  EXPECT_EQ(rows_for(even_beams(32)), 48);
  EXPECT_EQ(rows_for(even_beams(40)), 56);
  EXPECT_EQ(rows_for(even_beams(64)), 64);
  EXPECT_EQ(rows_for(hdl_64e()), 64);
  EXPECT_EQ(rows_for(even_beams(128)), 96);
  EXPECT_EQ(rows_for(even_beams(1024)), 128);
}

TEST(ForSensor, GivesUnevenBeamsRowsThatTellMostOfThemApart) {
  SensorModel uneven = even_beams(32);
  // As of a VLP-32C: a third of a degree apart near the horizon.
  for (int ring = 0; ring < 32; ++ring) {
    const double steps = ring - 12.0;
    const double beyond = std::max(0.0, std::abs(steps) - 9.0);
    uneven.beam_elevations.push_back((-0.333 * steps - std::copysign(beyond, steps)) * degree);
  }
  ASSERT_EQ(uneven.faults(), "");
  EXPECT_EQ(rows_for(uneven), 64);
}

TEST(ForSensor, GivesBandsARowEachAndSeveralLidarsAsManyAsTheModelHas) {
  SensorModel sensor = even_beams(40);
  sensor.pattern = ScanPattern::irregular;
  EXPECT_EQ(rows_for(sensor), 40);
  sensor.pattern = ScanPattern::merged;
  EXPECT_EQ(rows_for(sensor), 64);
  sensor.rings = 128;
  EXPECT_EQ(rows_for(sensor), 96);
}

TEST(ForSensor, FitsAnyNumberOfRingsAndAFieldOfViewUpToTheZenith) {
  ModelDescription model = test::describe_family(64, 64, 20);
  model.follow_sensor = true;
  model.network_file = test::write_model(test::light_bytes(8, 0, 0, 20));
  const Scan scan = test::random_scan(500, 3);
  for (const int rings : {1, 17, 63, 129}) {
    SensorModel sensor = even_beams(rings);
    sensor.fov_up = 90.0 * degree;
    const ModelDescription fitted = for_sensor(model, sensor);
    EXPECT_EQ(fitted.faults(), "");
    EXPECT_EQ(open_model(fitted)->segment(scan).classes.size(), scan.size()) << rings;
  }
}

TEST(ForSensor, TakesNoMoreColumnsThanASensorOfFewBeamsFills) {
  ModelDescription model = test::describe_family(64, 2048, 20);
  model.follow_sensor = true;
  EXPECT_EQ(for_sensor(model, vlp_16()).columns, 1536);
  EXPECT_EQ(for_sensor(model, hdl_32e()).columns, 2048);
  EXPECT_EQ(for_sensor(model, hdl_64e()).columns, 2048);
  model.columns = 512;
  EXPECT_EQ(for_sensor(model, vlp_16()).columns, 512);
}

TEST(ForSensor, LetsOneNetworkLabelScansOfDifferentSensors) {
  ModelDescription model = test::describe_family(64, 64, 20);
  model.follow_sensor = true;
  model.network_file = test::write_model(test::light_bytes(8, 0, 0, 20));
  const Scan scan = test::random_scan(500, 3);
  for (const SensorModel& sensor : {vlp_16(), hdl_32e(), hdl_64e()}) {
    const PointLabels labels = open_model(for_sensor(model, sensor))->segment(scan);
    EXPECT_EQ(labels.classes.size(), scan.size()) << sensor.name;
  }
}

}  // namespace
}  // namespace stillmap
