#pragma once

#include "config/loaders/config_report.hpp"
#include "config/loaders/yaml_section.hpp"
#include "core/mapper.hpp"

namespace stillmap {

/// Reads the sections `prepare`, `odometry` and `static_map`.
void read_mapper(YamlSection& file, MapperConfig& mapper);

/// What a server file leaves to the sensor: points nearer or farther than it measures are dropped.
/// `report` tells what the file leaves out.
void take_range_of_sensor(const ConfigReport& report, MapperConfig& mapper);

}  // namespace stillmap
