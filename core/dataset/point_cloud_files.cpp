#include "core/dataset/point_cloud_files.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/cloud_content.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/lidar/label_kind.hpp"
#include "core/lidar/point_fields.hpp"
#include "core/process/file_beside.hpp"

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

/// "Scalar_Intensity" is "intensity": editors rename what they save.
std::string plain_name(std::string name) {
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
  constexpr std::string_view prefix = "scalar_";
  return name.starts_with(prefix) ? name.substr(prefix.size()) : name;
}

/// The field with the first of these names that the cloud has, as it is or else renamed.
std::optional<Column> find_column(const CloudContent& cloud,
                                  const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    for (const bool renamed : {false, true}) {
      std::uint64_t offset = 0;
      for (const CloudField& field : cloud.fields) {
        const bool is_it =
            renamed ? plain_name(field.name) == plain_name(name) : field.name == name;
        if (is_it) return read_column(cloud, field, offset);
        offset += field.bytes * field.count;
      }
    }
  }
  return std::nullopt;
}

/// "intensity from scalar_Intensity (float32)", or what goes without it.
std::string source_of(const std::string& what, const std::optional<Column>& column,
                      const std::string& remark = {}) {
  if (!column) return "no " + what;
  const CloudField& field = column->field;
  const std::string kind = field.kind == 'F' ? "float" : (field.kind == 'I' ? "int" : "uint");
  return what + " from " + field.name.substr(0, 40) + " (" + kind +
         std::to_string(8 * field.bytes) + (remark.empty() ? "" : ": " + remark) + ")";
}

/// The column with the first of these names, negative where it has a "-" in front.
std::optional<Column> find_coordinate(const CloudContent& cloud,
                                      const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const auto [field, sign] = coordinate_field(name);
    std::optional<Column> column = find_column(cloud, {field});
    if (!column) continue;
    for (double& value : column->values) value *= static_cast<double>(sign);
    return column;
  }
  return std::nullopt;
}

std::vector<Eigen::Vector3f> points_of(const std::filesystem::path& file, const CloudContent& cloud,
                                       const PointFieldNames& names) {
  const auto x = find_coordinate(cloud, names.x);
  const auto y = find_coordinate(cloud, names.y);
  const auto z = find_coordinate(cloud, names.z);
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

/// What is to be said of fields that are those of CARLA's save_to_disk(), where nobody has put
/// their axes right: a mirrored world maps as well as any, and no scan tells it.
std::string remark_on_axes(const CloudContent& cloud, const PointFieldNames& names) {
  if (names.y != PointFieldNames().y) return {};
  std::string fields;
  for (const CloudField& field : cloud.fields) fields.append(" ").append(field.name, 0, 40);
  if (fields != " x y z I" && fields != " x y z CosAngle ObjIdx ObjTag") return {};
  return "; these fields are as CARLA's, whose y points to the right: then the map is mirrored, "
         "unless "
         "'input: {fields: {y: [-y]}}' in a --config file says so";
}

std::vector<float> intensity_of(const std::optional<Column>& intensity) {
  if (!intensity) return {};
  std::vector<float> values;
  values.reserve(intensity->values.size());
  for (const double value : intensity->values) values.push_back(static_cast<float>(value));
  return values;
}

PointTimes times_of(const std::optional<Column>& time, std::int64_t stamp_ns) {
  if (!time) return {};
  const TimeType floating = time->field.bytes == 4 ? TimeType::float32 : TimeType::float64;
  const TimeType type = time->field.kind == 'F' ? floating : TimeType::integer;
  return point_times(time->values, type, stamp_ns);
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

/// The same; also empty where floats of 32 bits cannot hold them.
std::vector<std::uint32_t> labels_of(const CloudContent& cloud, const PointFieldNames& names) {
  const auto label = find_column(cloud, names.label);
  const bool is_float32 = label && label->field.kind == 'F' && label->field.bytes == 4;
  if (is_float32 && !label->all_within(0.0, first_inexact_float_label - 1.0)) return {};
  return whole_numbers<std::uint32_t>(label);
}

constexpr std::size_t pcd_point_bytes = 24;
constexpr std::size_t ply_point_bytes = 23;

/// Puts values behind one another without padding.
class Packer {
 public:
  explicit Packer(char* to) : to_(to) {}

  template <class T>
  Packer& operator<<(const T& value) {
    std::memcpy(to_, &value, sizeof value);
    to_ += sizeof value;
    return *this;
  }

 private:
  char* to_;
};

std::uint32_t label_of(const ColouredPoint& point) { return semantic_kitti_id(point.label); }

void pack_pcd(const ColouredPoint& point, char* to) {
  const Rgb rgb = colour(point.label);
  const std::uint32_t packed_rgb =
      (std::uint32_t{rgb.r} << 16U) | (std::uint32_t{rgb.g} << 8U) | rgb.b;
  Packer(to) << point.position.x() << point.position.y() << point.position.z() << packed_rgb
             << label_of(point) << point.confidence;
}

void pack_ply(const ColouredPoint& point, char* to) {
  const Rgb rgb = colour(point.label);
  Packer(to) << point.position.x() << point.position.y() << point.position.z() << rgb.r << rgb.g
             << rgb.b << label_of(point) << point.confidence;
}

template <std::size_t point_bytes, class Pack>
void write_cloud(const std::filesystem::path& file, const std::string& header,
                 std::span<const ColouredPoint> points, Pack pack) {
  FileBeside beside(file);
  std::ofstream out(beside.path(), std::ios::binary | std::ios::trunc);
  out << header;
  std::array<char, point_bytes> bytes{};
  for (const ColouredPoint& point : points) {
    pack(point, bytes.data());
    out.write(bytes.data(), point_bytes);
  }
  out.close();
  if (out && !beside.put_in_place()) return;
  throw DatasetWriteError(file, "cannot be written; check the folder and the space left");
}

}  // namespace

CloudFile read_point_cloud(const std::filesystem::path& file, std::int64_t stamp_ns,
                           const PointFieldNames& names) {
  const CloudContent cloud =
      ending_of(file) == ".ply" ? read_ply_content(file) : read_pcd_content(file);
  const auto intensity = find_column(cloud, names.intensity);
  const auto time = find_column(cloud, names.time);
  const auto ring = find_column(cloud, names.ring);
  PointTimes times = times_of(time, stamp_ns);
  CloudFile read;
  read.scan.stamp_ns = stamp_ns;
  read.scan.points_lidar = points_of(file, cloud, names);
  read.scan.intensity = intensity_of(intensity);
  read.scan.time_offset_s = std::move(times.offsets_s);
  read.scan.ring = whole_numbers<std::uint16_t>(ring);
  read.raw_labels = labels_of(cloud, names);
  const bool is_no_ring = ring && read.scan.ring.empty() && !ring->values.empty();
  read.format = axes_in_words(names) + source_of("intensity", intensity) + ", " +
                source_of("time", time, times.remark) + ", " +
                source_of("ring", ring, is_no_ring ? "ignored: not whole numbers" : "") +
                remark_on_axes(cloud, names);
  return read;
}

void write_pcd(const std::filesystem::path& file, std::span<const ColouredPoint> points) {
  const std::string count = std::to_string(points.size());
  // By convention the bits of a colour stand in a field of type float.
  write_cloud<pcd_point_bytes>(file,
                               "# .PCD v0.7 - Point Cloud Data file format\n"
                               "VERSION 0.7\n"
                               "FIELDS x y z rgb label confidence\n"
                               "SIZE 4 4 4 4 4 4\n"
                               "TYPE F F F F U F\n"
                               "COUNT 1 1 1 1 1 1\n"
                               "WIDTH " +
                                   count +
                                   "\nHEIGHT 1\n"
                                   "VIEWPOINT 0 0 0 1 0 0 0\n"
                                   "POINTS " +
                                   count + "\nDATA binary\n",
                               points, pack_pcd);
}

void write_ply(const std::filesystem::path& file, std::span<const ColouredPoint> points) {
  write_cloud<ply_point_bytes>(file,
                               "ply\n"
                               "format binary_little_endian 1.0\n"
                               "element vertex " +
                                   std::to_string(points.size()) +
                                   "\n"
                                   "property float x\n"
                                   "property float y\n"
                                   "property float z\n"
                                   "property uchar red\n"
                                   "property uchar green\n"
                                   "property uchar blue\n"
                                   "property uint label\n"
                                   "property float confidence\n"
                                   "end_header\n",
                               points, pack_ply);
}

}  // namespace stillmap
