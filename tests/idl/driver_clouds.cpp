#include "tests/idl/driver_clouds.hpp"

#include <cmath>
#include <cstring>
#include <limits>

#include "idl/conversions/header.hpp"

namespace stillmap::wire {
namespace {

using enum FieldType;

constexpr std::uint32_t rows = 16;
constexpr std::uint32_t columns = 64;
constexpr double duration_s = 0.1;

std::vector<DriverField> xyz() { return {{"x", 0, float32}, {"y", 4, float32}, {"z", 8, float32}}; }

std::vector<DriverField> xyz_and(std::vector<DriverField> more) {
  std::vector<DriverField> fields = xyz();
  fields.insert(fields.end(), more.begin(), more.end());
  return fields;
}

/// velodyne_pointcloud of ROS 2, and its older layout that PCL pads.
void add_velodyne(std::vector<DriverLayout>& layouts) {
  const auto fields =
      xyz_and({{"intensity", 12, float32}, {"ring", 16, uint16}, {"time", 18, float32}});
  using enum DriverTime;
  layouts.push_back(
      {"Velodyne", fields, 22, seconds_before_stamp, "intensity", 255, "ring", false, true, 0});
  layouts.push_back({"VelodyneOrganised", fields, 22, seconds_from_first_point, "intensity", 255,
                     "ring", true, true, 0});
  layouts.push_back(
      {"VelodyneOfPcl",
       xyz_and({{"intensity", 16, float32}, {"ring", 20, uint16}, {"time", 24, float32}}), 32,
       seconds_from_first_point, "intensity", 255, "ring", false, true, 0});
}

/// ouster-ros: 1024 columns in 64 or 128 rows, zeros where nothing was measured. Older versions
/// have the ring in 8 bits.
void add_ouster(std::vector<DriverLayout>& layouts) {
  using enum DriverTime;
  layouts.push_back({"Ouster",
                     xyz_and({{"intensity", 16, float32},
                              {"t", 20, uint32},
                              {"reflectivity", 24, uint16},
                              {"ring", 26, uint16},
                              {"ambient", 28, uint16},
                              {"range", 32, uint32}}),
                     48, nanoseconds_from_first_point, "reflectivity", 255, "ring", true, false,
                     0});
  layouts.push_back({"OusterOfFirmware2",
                     xyz_and({{"intensity", 16, float32},
                              {"t", 20, uint32},
                              {"reflectivity", 24, uint16},
                              {"ring", 26, uint8},
                              {"noise", 28, uint16},
                              {"range", 32, uint32}}),
                     48, nanoseconds_from_first_point, "reflectivity", 255, "ring", true, false,
                     0});
  layouts.push_back({"OusterLegacyReflectivity",
                     xyz_and({{"intensity", 16, float32},
                              {"t", 20, uint32},
                              {"reflectivity", 24, uint16},
                              {"ring", 26, uint8},
                              {"ambient", 28, uint16},
                              {"range", 32, uint32}}),
                     48, nanoseconds_from_first_point, "reflectivity", 65535, "ring", true, false,
                     32});
  // The first driver counts its nanoseconds in floats.
  layouts.push_back({"OusterOfTheFirstDriver",
                     xyz_and({{"t", 16, float32},
                              {"reflectivity", 20, uint16},
                              {"intensity", 22, uint16},
                              {"ring", 24, uint8}}),
                     32, nanoseconds_from_first_point, "reflectivity", 255, "ring", true, false,
                     0});
}

void add_hesai(std::vector<DriverLayout>& layouts) {
  using enum DriverTime;
  layouts.push_back(
      {"Hesai",
       xyz_and({{"intensity", 12, float32}, {"ring", 16, uint16}, {"timestamp", 18, float64}}), 26,
       seconds_since_1970, "intensity", 255, "ring", false, true, 0});
  layouts.push_back(
      {"HesaiGeneral",
       xyz_and({{"intensity", 16, float32}, {"timestamp", 24, float64}, {"ring", 32, uint16}}), 48,
       seconds_since_1970, "intensity", 255, "ring", false, true, 0});
}

/// livox_ros_driver2 (its `line` counts the lasers, which do not keep their elevation), the older
/// driver without times, and its own message as it is commonly converted.
void add_livox(std::vector<DriverLayout>& layouts) {
  using enum DriverTime;
  layouts.push_back({"Livox",
                     xyz_and({{"intensity", 12, float32},
                              {"tag", 16, uint8},
                              {"line", 17, uint8},
                              {"timestamp", 18, float64}}),
                     26, nanoseconds_since_1970, "intensity", 255, "", false, true, 0});
  layouts.push_back({"LivoxWithoutTimes",
                     xyz_and({{"intensity", 12, float32}, {"tag", 16, uint8}, {"line", 17, uint8}}),
                     18, none, "intensity", 255, "", false, true, 0});
  layouts.push_back({"LivoxCustomMessage",
                     {{"offset_time", 0, uint32},
                      {"x", 4, float32},
                      {"y", 8, float32},
                      {"z", 12, float32},
                      {"reflectivity", 16, uint8},
                      {"tag", 17, uint8},
                      {"line", 18, uint8}},
                     19,
                     nanoseconds_from_first_point,
                     "reflectivity",
                     255,
                     "",
                     false,
                     true,
                     0});
}

/// rslidar_sdk, organised with NaN unless dense_points is set.
void add_robosense(std::vector<DriverLayout>& layouts) {
  using enum DriverTime;
  const auto fields =
      xyz_and({{"intensity", 12, float32}, {"ring", 16, uint16}, {"timestamp", 18, float64}});
  layouts.push_back(
      {"RoboSense", fields, 26, seconds_since_1970, "intensity", 255, "ring", true, true, 0});
  layouts.push_back(
      {"RoboSenseDense", fields, 26, seconds_since_1970, "intensity", 255, "ring", false, true, 0});
  layouts.push_back(
      {"RoboSenseOfPcl",
       xyz_and({{"intensity", 16, uint8}, {"ring", 18, uint16}, {"timestamp", 24, float64}}), 32,
       seconds_since_1970, "intensity", 255, "ring", true, true, 6});
}

/// Nebula's (Autoware), and what simulators send.
void add_others(std::vector<DriverLayout>& layouts) {
  using enum DriverTime;
  layouts.push_back({"Nebula",
                     xyz_and({{"intensity", 12, uint8},
                              {"return_type", 13, uint8},
                              {"channel", 14, uint16},
                              {"azimuth", 16, float32},
                              {"elevation", 20, float32},
                              {"distance", 24, float32},
                              {"time_stamp", 28, uint32}}),
                     32, nanoseconds_from_first_point, "intensity", 255, "channel", false, true,
                     0});
  layouts.push_back({"GazeboFloatRing",
                     xyz_and({{"intensity", 16, float32}, {"ring", 20, float32}}), 24, none,
                     "intensity", 1, "ring", true, true, 0});
  layouts.push_back({"Kitti", xyz_and({{"i", 12, float32}}), 16, none, "i", 1, "", false, true, 0});
}

double time_of(DriverTime time, double stamp_s, double offset_s) {
  switch (time) {
    case DriverTime::none:
      return 0.0;
    case DriverTime::seconds_from_first_point:
      return offset_s;
    case DriverTime::seconds_before_stamp:
      return offset_s - duration_s;
    case DriverTime::nanoseconds_from_first_point:
      return std::round(offset_s * 1e9);
    case DriverTime::seconds_since_1970:
      return stamp_s + offset_s;
    case DriverTime::nanoseconds_since_1970:
      return (stamp_s + offset_s) * 1e9;
  }
  return 0.0;
}

bool is_time(const std::string& field) {
  for (const char* name : {"time", "t", "timestamp", "time_stamp", "offset_time"}) {
    if (field == name) return true;
  }
  return false;
}

double value_of(const DriverLayout& layout, const std::string& field, const Scan& seen,
                std::size_t i) {
  const Eigen::Vector3f& p = seen.points_lidar[i];
  const bool measured = was_measured(i) || !layout.organised;
  const float invalid = layout.invalid_is_nan ? std::numeric_limits<float>::quiet_NaN() : 0.0F;
  if (field == "x") return measured ? p.x() : invalid;
  if (field == "y") return measured ? p.y() : invalid;
  if (field == "z") return measured ? p.z() : invalid;
  if (field == layout.intensity) {
    const double value = seen.intensity[i] * layout.full_scale;
    return layout.full_scale > 1.0F ? std::round(value) : value;
  }
  if (field == layout.ring) return seen.ring[i];
  const double stamp_s = static_cast<double>(seen.stamp_ns) * 1e-9;
  // Drivers leave the time of a point that was not measured at 0, or give it its own.
  if (is_time(field)) {
    return measured || i % 2 == 0 ? time_of(layout.time, stamp_s, seen.time_offset_s[i]) : 0.0;
  }
  // Photons, flags, lasers: nothing that may be taken for something else.
  return static_cast<double>(i % 5);
}

void put(FieldType type, double value, std::uint8_t* to) {
  with_type(type, [&]<typename T>(T) {
    const T typed = static_cast<T>(value);
    std::memcpy(to, &typed, sizeof typed);
  });
}

}  // namespace

std::vector<DriverLayout> driver_layouts() {
  std::vector<DriverLayout> layouts;
  add_velodyne(layouts);
  add_ouster(layouts);
  add_hesai(layouts);
  add_livox(layouts);
  add_robosense(layouts);
  add_others(layouts);
  return layouts;
}

bool was_measured(std::size_t i) { return i % 11 != 3; }

Scan seen_by_driver() {
  Scan seen;
  seen.stamp_ns = 1'700'000'000'250'000'000;
  for (std::uint32_t row = 0; row < rows; ++row) {
    for (std::uint32_t column = 0; column < columns; ++column) {
      const std::size_t i = seen.size();
      const float angle = 0.098F * static_cast<float>(column);
      seen.points_lidar.emplace_back(9.0F * std::cos(angle), 9.0F * std::sin(angle),
                                     0.3F * static_cast<float>(row) - 2.0F);
      seen.intensity.push_back(static_cast<float>((i * 37) % 256) / 255.0F);
      seen.ring.push_back(static_cast<std::uint16_t>(row));
      seen.time_offset_s.push_back(
          static_cast<float>(duration_s * column / static_cast<double>(columns)));
    }
  }
  return seen;
}

sensor_msgs::msg::PointCloud2 as_driver_sends(const DriverLayout& layout, const Scan& seen) {
  sensor_msgs::msg::PointCloud2 cloud;
  cloud.header(to_header(seen.stamp_ns, "sensor"));
  cloud.height(layout.organised ? rows : 1);
  cloud.width(layout.organised ? columns : rows * columns);
  cloud.point_step(layout.point_step);
  cloud.row_step(cloud.width() * layout.point_step + layout.row_padding);
  cloud.is_dense(!layout.organised);
  for (const DriverField& field : layout.fields) {
    sensor_msgs::msg::PointField described;
    described.name(field.name);
    described.offset(field.offset);
    described.datatype(static_cast<std::uint8_t>(field.type));
    described.count(1);
    cloud.fields().push_back(described);
  }
  // What lies between the fields is not to be read.
  cloud.data().assign(std::size_t{cloud.height()} * cloud.row_step(), 0xA5);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const std::size_t row = i / cloud.width(), column = i % cloud.width();
    std::uint8_t* point = cloud.data().data() + row * cloud.row_step() + column * layout.point_step;
    for (const DriverField& field : layout.fields) {
      put(field.type, value_of(layout, field.name, seen, i), point + field.offset);
    }
  }
  return cloud;
}

}  // namespace stillmap::wire
