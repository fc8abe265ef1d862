#include "config/loaders/sensor_file.hpp"

#include <yaml-cpp/emitter.h>

#include <Eigen/Geometry>
#include <cassert>
#include <fstream>
#include <map>
#include <stdexcept>
#include <vector>

#include "config/loaders/closest_name.hpp"
#include "config/loaders/named_file.hpp"
#include "config/loaders/yaml_section.hpp"
#include "core/lidar/angle_units.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, SensorModel (*)()>& built_in_sensors() {
  static const std::map<std::string, SensorModel (*)()> sensors{
      {"hdl_64e", hdl_64e}, {"hdl_32e", hdl_32e}, {"vlp_16", vlp_16}};
  return sensors;
}

const std::vector<YamlSection::Choice<RingSource>>& ring_sources() {
  static const std::vector<YamlSection::Choice<RingSource>> sources{
      {"field", RingSource::field},
      {"order", RingSource::order},
      {"elevation", RingSource::elevation}};
  return sources;
}

const std::vector<YamlSection::Choice<ScanPattern>>& scan_patterns() {
  static const std::vector<YamlSection::Choice<ScanPattern>> patterns{
      {"rings", ScanPattern::rings}, {"irregular", ScanPattern::irregular}};
  return patterns;
}

template <class Value>
std::string name_of(Value wanted, const std::vector<YamlSection::Choice<Value>>& choices) {
  for (const YamlSection::Choice<Value>& choice : choices) {
    if (choice.value == wanted) return choice.name;
  }
  assert(false);
  return {};
}

/// Roll about x, then pitch about y, then yaw about z, all axes fixed, as URDF and
/// static_transform_publisher have them.
Eigen::Matrix3d rotation_of(const std::vector<double>& roll_pitch_yaw) {
  return (Eigen::AngleAxisd(roll_pitch_yaw[2], Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(roll_pitch_yaw[1], Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_pitch_yaw[0], Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

void read_imu(YamlSection section, std::optional<ImuMount>& imu) {
  std::vector<double> roll_pitch_yaw;
  double time_offset_s = 0.0;
  section.degrees_list("roll_pitch_yaw_deg", roll_pitch_yaw, {-360, 360});
  section.number("time_offset_s", time_offset_s, {-0.15, 0.15});
  if (roll_pitch_yaw.size() == 3) {
    imu = ImuMount{.R_lidar_imu = rotation_of(roll_pitch_yaw), .time_offset_s = time_offset_s};
  } else if (!roll_pitch_yaw.empty() || time_offset_s != 0.0) {
    section.fault("roll_pitch_yaw_deg", "needs three angles: the IMU's axes in the lidar's frame");
  }
}

void read_motion_limits(YamlSection section, MotionLimits& limits) {
  section.number("max_speed_m_s", limits.max_speed_m_s, {0.1, 10000});
  section.number("max_acceleration_m_s2", limits.max_acceleration_m_s2, {0.1, 10000});
  section.degrees("max_turn_rate_deg_s", limits.max_turn_rate_rad_s, {1, 10000});
}

void read_sensor(YamlSection& file, SensorModel& sensor) {
  file.require({"name", "rings", "fov_up_deg", "fov_down_deg"});
  file.text("name", sensor.name);
  file.choice<ScanPattern>("pattern", sensor.pattern, scan_patterns());
  file.integer("rings", sensor.rings, {1, 1024});
  file.degrees("fov_up_deg", sensor.fov_up, {-90, 90});
  file.degrees("fov_down_deg", sensor.fov_down, {-90, 90});
  file.degrees_list("beam_elevations_deg", sensor.beam_elevations, {-90, 90});
  file.degrees("elevation_offset_deg", sensor.elevation_offset, {-5, 5});
  file.integer("columns", sensor.columns, {16, 65536});
  file.number("min_range_m", sensor.min_range_m, {0, 1000});
  file.number("max_range_m", sensor.max_range_m, {0.1, 10000});
  file.number("period_s", sensor.period_s, {0.001, 60});
  file.choice<RingSource>("ring_source", sensor.ring_source, ring_sources());
  file.number("intensity_scale", sensor.intensity_scale, {1e-9, 1e9});
  read_imu(file.section("imu"), sensor.imu);
  read_motion_limits(file.section("motion_limits"), sensor.motion_limits);
  file.faults(sensor.faults());
}

}  // namespace

void save_sensor(const SensorModel& sensor, const fs::path& file) {
  YAML::Emitter yaml;
  yaml << YAML::BeginMap << YAML::Key << "name" << YAML::Value << sensor.name;
  yaml << YAML::Key << "pattern" << YAML::Value << name_of(sensor.pattern, scan_patterns());
  yaml << YAML::Key << "rings" << YAML::Value << sensor.rings;
  yaml << YAML::Key << "fov_up_deg" << YAML::Value << sensor.fov_up / rad_per_deg;
  yaml << YAML::Key << "fov_down_deg" << YAML::Value << sensor.fov_down / rad_per_deg;
  yaml << YAML::Key << "beam_elevations_deg" << YAML::Value << YAML::Flow << YAML::BeginSeq;
  for (const double elevation : sensor.beam_elevations) yaml << elevation / rad_per_deg;
  yaml << YAML::EndSeq;
  yaml << YAML::Key << "elevation_offset_deg" << YAML::Value
       << sensor.elevation_offset / rad_per_deg;
  yaml << YAML::Key << "columns" << YAML::Value << sensor.columns;
  yaml << YAML::Key << "min_range_m" << YAML::Value << sensor.min_range_m;
  yaml << YAML::Key << "max_range_m" << YAML::Value << sensor.max_range_m;
  yaml << YAML::Key << "period_s" << YAML::Value << sensor.period_s;
  yaml << YAML::Key << "ring_source" << YAML::Value << name_of(sensor.ring_source, ring_sources());
  yaml << YAML::Key << "intensity_scale" << YAML::Value << sensor.intensity_scale;
  if (sensor.imu) {
    const Eigen::Vector3d yaw_pitch_roll =
        sensor.imu->R_lidar_imu.eulerAngles(2, 1, 0) / rad_per_deg;
    yaml << YAML::Key << "imu" << YAML::Value << YAML::BeginMap;
    yaml << YAML::Key << "roll_pitch_yaw_deg" << YAML::Value << YAML::Flow << YAML::BeginSeq
         << yaw_pitch_roll[2] << yaw_pitch_roll[1] << yaw_pitch_roll[0] << YAML::EndSeq;
    yaml << YAML::Key << "time_offset_s" << YAML::Value << sensor.imu->time_offset_s
         << YAML::EndMap;
  }
  const MotionLimits& limits = sensor.motion_limits;
  yaml << YAML::Key << "motion_limits" << YAML::Value << YAML::BeginMap;
  yaml << YAML::Key << "max_speed_m_s" << YAML::Value << limits.max_speed_m_s;
  yaml << YAML::Key << "max_acceleration_m_s2" << YAML::Value << limits.max_acceleration_m_s2;
  yaml << YAML::Key << "max_turn_rate_deg_s" << YAML::Value
       << limits.max_turn_rate_rad_s / rad_per_deg << YAML::EndMap;
  yaml << YAML::EndMap;
  std::ofstream out(file);
  out << yaml.c_str() << '\n';
  if (!out.flush()) throw std::runtime_error(file.string() + ": cannot be written");
}

SensorModel load_sensor(const std::string& name_or_file, const fs::path& folder) {
  const auto built_in = built_in_sensors().find(name_or_file);
  if (built_in != built_in_sensors().end()) return built_in->second();
  if (!is_file_name(name_or_file)) {
    std::vector<std::string> names;
    for (const auto& [name, make] : built_in_sensors()) names.push_back(name);
    throw ConfigError({"sensor '" + name_or_file + "' is neither built in nor a .yaml file" +
                       did_you_mean(name_or_file, names) +
                       " (Without a name the scans tell the lidar, and 'stillmap dataset sensor' "
                       "makes a file from a recording.)"});
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
