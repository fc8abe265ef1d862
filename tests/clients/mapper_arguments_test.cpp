#include "clients/commands/arguments/mapper_arguments.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <stdexcept>

#include "config/loaders/sensor_file.hpp"
#include "core/dataset/kitti_files.hpp"
#include "tests/config/config_files.hpp"
#include "tests/scratch_folder.hpp"

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

TEST(MapperArguments, ASensorThatMostScansCannotComeFromIsTold) {
  const ScratchFolder folder;
  Scan scan;
  for (int i = 0; i < 2000; ++i) {
    const double elevation = vlp_16().beam_elevation(i % 16), azimuth = 0.01 * i;
    scan.points_lidar.emplace_back(
        (9.0 * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                               std::cos(elevation) * std::sin(azimuth), std::sin(elevation)))
            .cast<float>());
  }
  scan.intensity.assign(scan.size(), 0.5F);
  for (const char* name : {"0.bin", "1.bin", "2.bin"}) write_kitti_bin(folder.path() / name, scan);
  std::filesystem::resize_file(folder.path() / "2.bin", 7);
  const ScanDataset dataset(folder.path());
  EXPECT_EQ(describe_sensor_mismatch(dataset, dataset.suggested_sensor()), "");
  EXPECT_THAT(describe_sensor_mismatch(dataset, hdl_64e()),
              testing::HasSubstr("points lie between -15 and 15 degrees of elevation"));
}

}  // namespace
}  // namespace stillmap::cli
