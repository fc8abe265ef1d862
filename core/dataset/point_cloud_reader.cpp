#include <pcl/PCLPointCloud2.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "core/dataset/point_cloud_loaders.hpp"
#include "core/lidar/point_fields.hpp"

namespace stillmap {
namespace {

using pcl::PCLPointField;

std::size_t bytes_of(std::uint8_t datatype) {
  switch (datatype) {
    case PCLPointField::INT8:
    case PCLPointField::UINT8:
      return 1;
    case PCLPointField::INT16:
    case PCLPointField::UINT16:
      return 2;
    case PCLPointField::INT32:
    case PCLPointField::UINT32:
    case PCLPointField::FLOAT32:
      return 4;
    case PCLPointField::FLOAT64:
      return 8;
    default:
      return 0;
  }
}

template <class T>
double value_at(const std::uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

double value_of(const std::uint8_t* bytes, std::uint8_t datatype) {
  switch (datatype) {
    case PCLPointField::INT8:
      return value_at<std::int8_t>(bytes);
    case PCLPointField::UINT8:
      return value_at<std::uint8_t>(bytes);
    case PCLPointField::INT16:
      return value_at<std::int16_t>(bytes);
    case PCLPointField::UINT16:
      return value_at<std::uint16_t>(bytes);
    case PCLPointField::INT32:
      return value_at<std::int32_t>(bytes);
    case PCLPointField::UINT32:
      return value_at<std::uint32_t>(bytes);
    case PCLPointField::FLOAT32:
      return value_at<float>(bytes);
    default:
      return value_at<double>(bytes);
  }
}

/// One field of all points.
struct Column {
  std::uint8_t datatype = 0;
  std::vector<double> values;

  [[nodiscard]] bool all_within(double least, double most) const {
    return std::ranges::all_of(values, [&](double v) { return v >= least && v <= most; });
  }
};

/// The first field with one of these names; nothing when there is none or it lies outside a point.
std::optional<Column> column(const pcl::PCLPointCloud2& cloud,
                             const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const auto field = std::ranges::find(cloud.fields, name, &PCLPointField::name);
    if (field == cloud.fields.end()) continue;
    const std::size_t bytes = bytes_of(field->datatype);
    if (bytes == 0 || field->offset + bytes > cloud.point_step) continue;
    const std::size_t points = std::size_t{cloud.width} * cloud.height;
    Column column{field->datatype, {}};
    column.values.reserve(points);
    for (std::size_t i = 0; i < points; ++i) {
      column.values.push_back(
          value_of(cloud.data.data() + i * cloud.point_step + field->offset, field->datatype));
    }
    return column;
  }
  return std::nullopt;
}

pcl::PCLPointCloud2 load(const std::filesystem::path& file) {
  return file.extension() == ".ply" ? load_ply(file) : load_pcd(file);
}

std::vector<Eigen::Vector3f> points_of(const std::filesystem::path& file,
                                       const pcl::PCLPointCloud2& cloud,
                                       const PointFieldNames& names) {
  const auto x = column(cloud, names.x), y = column(cloud, names.y), z = column(cloud, names.z);
  if (!x || !y || !z) {
    std::string present;
    for (const auto& field : cloud.fields) present += " " + field.name;
    throw DatasetError(file, "has no fields x, y and z, only:" + present);
  }
  std::vector<Eigen::Vector3f> points;
  points.reserve(x->values.size());
  for (std::size_t i = 0; i < x->values.size(); ++i) {
    points.emplace_back(Eigen::Vector3d(x->values[i], y->values[i], z->values[i]).cast<float>());
  }
  return points;
}

std::vector<float> intensity_of(const pcl::PCLPointCloud2& cloud, const PointFieldNames& names) {
  const auto intensity = column(cloud, names.intensity);
  if (!intensity) return {};
  std::vector<float> values;
  values.reserve(intensity->values.size());
  for (const double value : intensity->values) values.push_back(static_cast<float>(value));
  return values;
}

std::vector<float> time_offsets_of(const pcl::PCLPointCloud2& cloud, const PointFieldNames& names,
                                   std::int64_t stamp_ns) {
  const auto time = column(cloud, names.time);
  if (!time) return {};
  TimeType type = TimeType::integer;
  if (time->datatype == PCLPointField::FLOAT32) type = TimeType::float32;
  if (time->datatype == PCLPointField::FLOAT64) type = TimeType::float64;
  return point_times(time->values, type, stamp_ns).offsets_s;
}

/// A column of whole numbers that all fit into T, else empty.
template <class T>
std::vector<T> whole_numbers(const std::optional<Column>& column) {
  if (!column || !column->all_within(0.0, std::numeric_limits<T>::max())) return {};
  std::vector<T> values;
  values.reserve(column->values.size());
  for (const double value : column->values) values.push_back(static_cast<T>(value));
  return values;
}

}  // namespace

CloudFile read_point_cloud(const std::filesystem::path& file, std::int64_t stamp_ns) {
  const PointFieldNames names;
  const pcl::PCLPointCloud2 cloud = load(file);
  CloudFile read;
  read.scan.stamp_ns = stamp_ns;
  read.scan.points_lidar = points_of(file, cloud, names);
  read.scan.intensity = intensity_of(cloud, names);
  read.scan.time_offset_s = time_offsets_of(cloud, names, stamp_ns);
  read.scan.ring = whole_numbers<std::uint16_t>(column(cloud, names.ring));
  read.raw_labels = whole_numbers<std::uint32_t>(column(cloud, names.label));
  return read;
}

}  // namespace stillmap
