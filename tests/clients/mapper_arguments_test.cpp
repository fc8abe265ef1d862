#include "clients/commands/arguments/mapper_arguments.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "config/loaders/sensor_file.hpp"
#include "tests/config/config_files.hpp"

namespace stillmap::cli {
namespace {

SensorModel far_sighted() {
  SensorModel sensor = vlp_16();
  sensor.min_range_m = 1.5;
  sensor.max_range_m = 77.0;
  return sensor;
}

TEST(MapperArguments, ASuggestedSensorCountsAsItsFileDoes) {
  const auto file = test::write_file("far_sighted.yaml", "");
  save_sensor(far_sighted(), file);
  MapperArguments named;
  named.sensor = file.string();
  for (const MapperArguments& arguments : {MapperArguments{}, named}) {
    const MapperConfig config = mapper_config(arguments, far_sighted());
    EXPECT_EQ(config.prepare.min_range_m, 1.5);
    EXPECT_EQ(config.prepare.max_range_m, 77.0);
  }
}

TEST(MapperArguments, AServerFileLeavesTheSensorToTheRecordingUnlessItNamesIt) {
  MapperArguments arguments;
  arguments.config_file = test::write_file("any.yaml", "sensor: auto\n").string();
  EXPECT_EQ(mapper_config(arguments, far_sighted()).sensor.max_range_m, 77.0);
  arguments.config_file = test::write_file("named.yaml", "sensor: hdl_64e\n").string();
  EXPECT_EQ(mapper_config(arguments, far_sighted()).sensor.rings, 64);
}

TEST(MapperArguments, RangesOfAServerFileCountMore) {
  MapperArguments arguments;
  arguments.config_file =
      test::write_file("near.yaml", "prepare: {min_range_m: 2, max_range_m: 30}\n").string();
  const MapperConfig config = mapper_config(arguments, far_sighted());
  EXPECT_EQ(config.prepare.min_range_m, 2.0);
  EXPECT_EQ(config.prepare.max_range_m, 30.0);
}

TEST(MapperArguments, ARangeThatLeavesNoPointOfTheRecordingsSensorIsRefused) {
  MapperArguments arguments;
  arguments.config_file = test::write_file("blind.yaml", "prepare: {min_range_m: 80}\n").string();
  EXPECT_THROW((void)mapper_config(arguments, far_sighted()), std::invalid_argument);
  arguments.sensor = "hdl_64e";
  EXPECT_EQ(mapper_config(arguments, far_sighted()).prepare.min_range_m, 80.0);
}

}  // namespace
}  // namespace stillmap::cli
