#include <algorithm>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/dataset/cloud_content.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "core/lidar/point_fields.hpp"

namespace stillmap {
namespace {

/// One field of all points.
struct Column {
  CloudField field;
  std::vector<double> values;

  [[nodiscard]] bool all_within(double min, double max) const {
    return std::ranges::all_of(values, [&](double v) { return v >= min && v <= max; });
  }
};

Column read_column(const CloudContent& cloud, const CloudField& field, std::uint64_t offset) {
  const std::uint64_t point_bytes = cloud.point_bytes();
  Column column{field, {}};
  column.values.reserve(cloud.points());
  for (std::uint64_t i = 0; i < cloud.points(); ++i) {
    column.values.push_back(field_value(field, cloud.body.data() + i * point_bytes + offset));
  }
  return column;
}

/// The field with the first of these names that the cloud has.
std::optional<Column> find_column(const CloudContent& cloud,
                                  const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    std::uint64_t offset = 0;
    for (const CloudField& field : cloud.fields) {
      if (field.name == name) return read_column(cloud, field, offset);
      offset += field.bytes * field.count;
    }
  }
  return std::nullopt;
}

std::vector<Eigen::Vector3f> points_of(const std::filesystem::path& file, const CloudContent& cloud,
                                       const PointFieldNames& names) {
  const auto x = find_column(cloud, names.x);
  const auto y = find_column(cloud, names.y);
  const auto z = find_column(cloud, names.z);
  if (!x || !y || !z) {
    std::string present;
    for (const CloudField& field : cloud.fields) present.append(" ").append(field.name, 0, 40);
    throw DatasetError(file, "has no fields x, y and z, only:" + present);
  }
  std::vector<Eigen::Vector3f> points;
  points.reserve(x->values.size());
  for (std::size_t i = 0; i < x->values.size(); ++i) {
    points.emplace_back(Eigen::Vector3d(x->values[i], y->values[i], z->values[i]).cast<float>());
  }
  return points;
}

std::vector<float> intensity_of(const CloudContent& cloud, const PointFieldNames& names) {
  const auto intensity = find_column(cloud, names.intensity);
  if (!intensity) return {};
  std::vector<float> values;
  values.reserve(intensity->values.size());
  for (const double value : intensity->values) values.push_back(static_cast<float>(value));
  return values;
}

std::vector<float> time_offsets_of(const CloudContent& cloud, const PointFieldNames& names,
                                   std::int64_t stamp_ns) {
  const auto time = find_column(cloud, names.time);
  if (!time) return {};
  const TimeType floating = time->field.bytes == 4 ? TimeType::float32 : TimeType::float64;
  const TimeType type = time->field.kind == 'F' ? floating : TimeType::integer;
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
  const CloudContent cloud =
      file.extension() == ".ply" ? read_ply_content(file) : read_pcd_content(file);
  CloudFile read;
  read.scan.stamp_ns = stamp_ns;
  read.scan.points_lidar = points_of(file, cloud, names);
  read.scan.intensity = intensity_of(cloud, names);
  read.scan.time_offset_s = time_offsets_of(cloud, names, stamp_ns);
  read.scan.ring = whole_numbers<std::uint16_t>(find_column(cloud, names.ring));
  read.raw_labels = whole_numbers<std::uint32_t>(find_column(cloud, names.label));
  return read;
}

}  // namespace stillmap
