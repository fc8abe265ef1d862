#include "config/sensor_file.hpp"

#include <map>
#include <vector>

#include "config/closest_name.hpp"
#include "config/yaml_section.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, SensorModel (*)()>& built_in_sensors() {
  static const std::map<std::string, SensorModel (*)()> sensors{
      {"hdl_64e", hdl_64e}, {"hdl_32e", hdl_32e}, {"vlp_16", vlp_16}};
  return sensors;
}

bool is_file_name(const std::string& text) {
  return text.find('/') != std::string::npos || text.ends_with(".yaml") || text.ends_with(".yml");
}

void read_sensor(YamlSection& file, SensorModel& sensor) {
  file.require({"name", "rings", "fov_up_deg", "fov_down_deg"});
  file.text("name", sensor.name);
  file.whole("rings", sensor.rings, {1, 1024});
  file.degrees("fov_up_deg", sensor.fov_up, {-90, 90});
  file.degrees("fov_down_deg", sensor.fov_down, {-90, 90});
  file.degrees_list("beam_elevations_deg", sensor.beam_elevations, {-90, 90});
  file.whole("columns", sensor.columns, {16, 65536});
  file.number("min_range_m", sensor.min_range_m, {0, 1000});
  file.number("max_range_m", sensor.max_range_m, {0.1, 10000});
  file.number("period_s", sensor.period_s, {0.001, 60});
  file.choice<RingSource>("ring_source", sensor.ring_source,
                          {{"field", RingSource::field},
                           {"order", RingSource::order},
                           {"elevation", RingSource::elevation}});
  file.number("intensity_scale", sensor.intensity_scale, {1e-9, 1e9});
  file.faults(sensor.faults());
}

}  // namespace

SensorModel load_sensor(const std::string& name_or_file, const fs::path& folder) {
  const auto built_in = built_in_sensors().find(name_or_file);
  if (built_in != built_in_sensors().end()) return built_in->second();
  if (!is_file_name(name_or_file)) {
    std::vector<std::string> names;
    for (const auto& [name, make] : built_in_sensors()) names.push_back(name);
    throw ConfigError({"sensor '" + name_or_file + "' is neither built in nor a .yaml file" +
                       did_you_mean(name_or_file, names)});
  }
  YamlFile yaml = open_yaml(folder / name_or_file);
  SensorModel sensor;
  {
    YamlSection file(yaml);
    read_sensor(file, sensor);
  }
  yaml.require_no_faults();
  return sensor;
}

}  // namespace stillmap
