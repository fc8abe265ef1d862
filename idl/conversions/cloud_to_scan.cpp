#include "idl/conversions/cloud_to_scan.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>
#include <utility>
#include <vector>

#include "idl/conversions/header.hpp"
#include "idl/conversions/point_field.hpp"
#include "sensor_msgs.h"

namespace stillmap::wire {
namespace {

using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;

/// Where a value lies in each point of a cloud.
struct PointColumn {
  std::size_t offset = 0;
  FieldType type = FieldType::float32;
  /// As the cloud calls it.
  std::string name;
  /// Of a coordinate: -1 where its negative is meant.
  float sign = 1.0F;
};

/// The checked description of a cloud: every point of every column lies within the data.
struct CloudLayout {
  std::size_t width = 0;
  std::size_t height = 0;
  std::size_t point_step = 0;
  /// From one row to the next, padding included.
  std::size_t row_step = 0;
  bool swap_bytes = false;
  PointColumn x, y, z;
  std::optional<PointColumn> intensity, ring, time, label;

  [[nodiscard]] std::size_t points() const { return width * height; }
};

/// Either a layout or a fault.
struct CheckedLayout {
  std::optional<CloudLayout> layout;
  CloudFault fault;
};

// Ends the checks at the first fault.
struct Refusal {
  CloudFault fault;
};

[[noreturn]] void refuse(std::string counter, std::string reason) {
  throw Refusal{{std::move(counter), std::move(reason)}};
}

std::string number(std::uint64_t value) { return std::to_string(value); }

PointColumn checked_column(const PointField& field, std::size_t point_step) {
  const std::string name = "field " + field.name();
  const auto type = field_type(field.datatype());
  if (!type) {
    refuse("bad_field", name + " has datatype " + number(field.datatype()) + "; 1..8 exist");
  }
  if (field.count() != 1) {
    refuse("bad_field", name + " has count " + number(field.count()) + "; 1 is needed");
  }
  if (field.offset() + size_of(*type) > point_step) {
    refuse("bad_field", name + " ends at byte " + number(field.offset() + size_of(*type)) +
                            ", beyond point_step " + number(point_step));
  }
  return {.offset = field.offset(), .type = *type, .name = field.name()};
}

std::optional<PointColumn> find_column(const PointCloud2& cloud,
                                       const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const auto is_it = [&](const PointField& field) { return field.name() == name; };
    const auto found = std::ranges::find_if(cloud.fields(), is_it);
    if (found != cloud.fields().end()) return checked_column(*found, cloud.point_step());
  }
  return std::nullopt;
}

PointColumn coordinate(const PointCloud2& cloud, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const auto [field, sign] = coordinate_field(name);
    std::optional<PointColumn> column = find_column(cloud, {field});
    if (!column) continue;
    column->sign = sign;
    return *column;
  }
  refuse("no_xyz", "there is no field " +
                       coordinate_field(names.empty() ? "" : names.front()).name +
                       "; x, y and z are needed");
}

void check_sizes(const PointCloud2& cloud) {
  const std::uint64_t width = cloud.width();
  const std::uint64_t height = cloud.height();
  if (width == 0 || height == 0) {
    refuse("no_points", "width " + number(width) + " x height " + number(height) + " is no point");
  }
  if (cloud.point_step() == 0) refuse("size_mismatch", "point_step is 0");
  const std::uint64_t row_bytes = width * cloud.point_step();
  if (height > 1 && cloud.row_step() < row_bytes) {
    refuse("size_mismatch", "row_step " + number(cloud.row_step()) + " is less than width " +
                                number(width) + " x point_step " + number(cloud.point_step()));
  }
  // 32-bit factors: neither product reaches 2^64 / 2.
  const std::uint64_t needed = (height - 1) * cloud.row_step();
  const std::uint64_t available = cloud.data().size();
  if (needed > available || row_bytes > available - needed) {
    refuse("size_mismatch", "data has " + number(available) + " bytes, too few for width " +
                                number(width) + " x height " + number(height) +
                                " points of point_step " + number(cloud.point_step()));
  }
}

CloudLayout layout_of(const PointCloud2& cloud, const PointFieldNames& names) {
  check_sizes(cloud);
  constexpr bool here_big_endian = std::endian::native == std::endian::big;
  return {.width = cloud.width(),
          .height = cloud.height(),
          .point_step = cloud.point_step(),
          .row_step = cloud.row_step(),
          .swap_bytes = cloud.is_bigendian() != here_big_endian,
          .x = coordinate(cloud, names.x),
          .y = coordinate(cloud, names.y),
          .z = coordinate(cloud, names.z),
          .intensity = find_column(cloud, names.intensity),
          // Some simulators number the rings in floats.
          .ring = find_column(cloud, names.ring),
          .time = find_column(cloud, names.time),
          // Some tools write every field as a float.
          .label = find_column(cloud, names.label)};
}

/// Checks how a cloud describes itself against its data. Any input is fine.
CheckedLayout check_layout(const PointCloud2& cloud, const PointFieldNames& names) {
  try {
    return {.layout = layout_of(cloud, names), .fault = {}};
  } catch (const Refusal& refusal) {
    return {.layout = std::nullopt, .fault = refusal.fault};
  }
}

/// Calls `use(i, value)` for the column's value in every point, rows in order.
template <typename Use>
void for_each_value(const PointCloud2& cloud, const CloudLayout& layout, const PointColumn& column,
                    Use use) {
  with_type(column.type, [&]<typename T>(T) {
    std::size_t i = 0;
    for (std::size_t row = 0; row < layout.height; ++row) {
      const std::uint8_t* at = cloud.data().data() + row * layout.row_step + column.offset;
      for (std::size_t in_row = 0; in_row < layout.width; ++in_row, ++i) {
        use(i, load<T>(at + in_row * layout.point_step, layout.swap_bytes));
      }
    }
  });
}

std::vector<Eigen::Vector3f> read_points(const PointCloud2& cloud, const CloudLayout& layout) {
  std::vector<Eigen::Vector3f> points_lidar(layout.points());
  const auto read_axis = [&](const PointColumn& column, int axis) {
    for_each_value(cloud, layout, column, [&](std::size_t i, auto value) {
      points_lidar[i][axis] = column.sign * static_cast<float>(value);
    });
  };
  read_axis(layout.x, 0);
  read_axis(layout.y, 1);
  read_axis(layout.z, 2);
  return points_lidar;
}

std::vector<float> read_intensity(const PointCloud2& cloud, const CloudLayout& layout,
                                  float scale) {
  if (!layout.intensity) return {};
  std::vector<float> intensity(layout.points());
  for_each_value(cloud, layout, *layout.intensity, [&](std::size_t i, auto value) {
    intensity[i] = static_cast<float>(value) * scale;
  });
  return intensity;
}

std::vector<std::uint16_t> read_ring(const PointCloud2& cloud, const CloudLayout& layout) {
  if (!layout.ring) return {};
  std::vector<std::uint16_t> ring(layout.points());
  for_each_value(cloud, layout, *layout.ring, [&](std::size_t i, auto value) {
    const auto number = static_cast<double>(value);
    // Written so that NaN becomes 0.
    ring[i] = number > 0.0 ? static_cast<std::uint16_t>(std::min(number, 65535.0)) : 0;
  });
  return ring;
}

TimeType time_type(FieldType type) {
  if (is_integer(type)) return TimeType::integer;
  return type == FieldType::float32 ? TimeType::float32 : TimeType::float64;
}

PointTimes read_time(const PointCloud2& cloud, const CloudLayout& layout, std::int64_t stamp) {
  if (!layout.time) return {};
  std::vector<double> times(layout.points());
  for_each_value(cloud, layout, *layout.time,
                 [&](std::size_t i, auto value) { times[i] = static_cast<double>(value); });
  return point_times(times, time_type(layout.time->type), stamp);
}

/// A label as it is in the field. No number is 0, as padding points of organised clouds have it;
/// nothing for one that is not whole, or that this type may have rounded.
template <typename T>
std::optional<std::uint32_t> whole_label(T value) {
  if constexpr (std::is_integral_v<T>) {
    return static_cast<std::uint32_t>(value);
  } else {
    if (!std::isfinite(value)) return 0U;
    const auto label = static_cast<double>(value);
    constexpr double end = sizeof(T) == 4 ? first_inexact_float_label : 4294967296.0;
    if (label < 0.0 || label >= end || label != std::floor(label)) return std::nullopt;
    return static_cast<std::uint32_t>(label);
  }
}

/// The labels of a cloud and what their field was taken for; empty without such a field.
struct ReadLabels {
  std::vector<SemanticClass> classes;
  std::string remark;
  LabelCensus census = {};
  std::vector<std::uint32_t> raw = {};
};

ReadLabels read_labels(const PointCloud2& cloud, const CloudLayout& layout,
                       const CloudReadOptions& options) {
  if (!layout.label) return {};
  const bool are_classes = options.labels_are_classes;
  const LabelKind kind = are_classes ? LabelKind::classes : LabelKind::semantic_kitti;
  // SemanticKITTI's ids need more than 8 bits: a field of 8 is something else.
  if (!are_classes && size_of(layout.label->type) == 1) return {{}, "ignored"};
  ReadLabels read{.classes = std::vector<SemanticClass>(layout.points()),
                  .remark = are_classes ? "classes" : "SemanticKITTI ids"};
  bool are_whole = true;
  for_each_value(cloud, layout, *layout.label, [&](std::size_t i, auto value) {
    const std::optional<std::uint32_t> label = whole_label(value);
    are_whole &= label.has_value();
    read.classes[i] = class_of_label(label.value_or(0), kind);
    if (!are_classes) read.census.add(label.value_or(0));
    if (options.keeps_raw_labels) read.raw.push_back(label.value_or(0));
  });
  const bool is_float32 = layout.label->type == FieldType::float32;
  if (!are_whole)
    return {{},
            is_float32 ? "ignored: not whole numbers below 2^24" : "ignored: not whole numbers"};
  return read;
}

/// "intensity from reflectivity (uint16)", or what goes without it.
std::string source_of(const char* what, const std::optional<PointColumn>& column,
                      const std::string& remark = {}) {
  if (!column) return std::string("no ").append(what);
  std::string text = std::string(what).append(" from ").append(column->name).append(" (");
  text.append(name_of(column->type));
  if (!remark.empty()) text.append(": ").append(remark);
  return text.append(")");
}

std::string describe(const CloudLayout& layout, const PointTimes& times, const ReadLabels& labels) {
  std::string text = source_of("intensity", layout.intensity) + ", " +
                     source_of("time", layout.time, times.remark) + ", " +
                     source_of("ring", layout.ring);
  if (!layout.label) return text;
  return text + ", " + source_of("label", layout.label, labels.remark);
}

}  // namespace

ScanFromCloud to_scan(const PointCloud2& cloud, const CloudReadOptions& options) {
  const auto stamp = stamp_ns(cloud.header().stamp());
  if (!stamp) {
    return {.scan = std::nullopt,
            .fault = {"bad_stamp", "header.stamp.nanosec is " +
                                       std::to_string(cloud.header().stamp().nanosec()) +
                                       ", a second or more"},
            .format = {}};
  }
  const auto [layout, fault] = check_layout(cloud, options.fields);
  if (!layout) return {.scan = std::nullopt, .fault = fault, .format = {}};
  PointTimes times = read_time(cloud, *layout, *stamp);
  ReadLabels labels = read_labels(cloud, *layout, options);
  std::string format = axes_in_words(options.fields) + describe(*layout, times, labels);
  return {.scan = Scan{.stamp_ns = *stamp,
                       .points_lidar = read_points(cloud, *layout),
                       .intensity = read_intensity(cloud, *layout, options.intensity_scale),
                       .time_offset_s = std::move(times.offsets_s),
                       .ring = read_ring(cloud, *layout),
                       .labels = std::move(labels.classes)},
          .fault = {},
          .format = std::move(format),
          .label_census = labels.census,
          .raw_labels = std::move(labels.raw)};
}

CloudReader::CloudReader(const CloudReadOptions& options)
    : options_(options), intensity_scale_(options.intensity_scale) {
  // The scale is applied here.
  options_.intensity_scale = 1.0F;
}

CloudReader::Result CloudReader::read(const sensor_msgs::msg::PointCloud2& cloud) {
  Result result{.from_cloud = to_scan(cloud, options_), .format_change = {}};
  if (!result.from_cloud.scan) return result;
  const std::string corrected = intensity_scale_.apply(result.from_cloud.scan->intensity);
  const std::string& format = result.from_cloud.format;
  if (format != format_) result.format_change = format_ = format;
  if (!corrected.empty()) {
    result.format_change.append(result.format_change.empty() ? "" : "; ").append(corrected);
  }
  return result;
}

}  // namespace stillmap::wire
