#pragma once

#include <filesystem>
#include <string>

#include "config/loaders/config_error.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// A built-in sensor by its name (hdl_64e, hdl_32e, vlp_16), or a sensor file like those in
/// config/sensors; a relative path starts at `folder`. Throws ConfigError with every fault.
[[nodiscard]] SensorModel load_sensor(const std::string& name_or_file,
                                      const std::filesystem::path& folder = {});

/// Writes a sensor file that `load_sensor` reads back as the same sensor.
/// @throws std::runtime_error that names the file when it cannot be written.
void save_sensor(const SensorModel& sensor, const std::filesystem::path& file);

}  // namespace stillmap
