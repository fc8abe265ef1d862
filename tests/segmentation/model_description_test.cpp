#include "core/segmentation/model_description.hpp"

#include <gtest/gtest.h>

#include "core/segmentation/network_segmenter.hpp"
#include "tests/segmentation/onnx_builder.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

TEST(ForSensor, GivesOnlyAModelThatFollowsTheSensorsRowsAndFieldOfView) {
  ModelDescription model = test::describe_family(64, 1024, 20);
  EXPECT_EQ(for_sensor(model, vlp_16()).rows, 64);
  model.follow_sensor = true;
  const ModelDescription fitted = for_sensor(model, vlp_16());
  EXPECT_EQ(fitted.rows, 16);
  EXPECT_EQ(fitted.columns, 1024);
  EXPECT_EQ(fitted.fov_up, vlp_16().fov_up);
  EXPECT_EQ(fitted.fov_down, vlp_16().fov_down);
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
