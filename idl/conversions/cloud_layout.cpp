#include "idl/conversions/cloud_layout.hpp"

#include <algorithm>
#include <bit>
#include <utility>
#include <vector>

#include "sensor_msgs.h"

namespace stillmap::wire {
namespace {

using sensor_msgs::msg::PointCloud2;
using sensor_msgs::msg::PointField;

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

std::optional<PointColumn> find_integer_column(const PointCloud2& cloud,
                                               const std::vector<std::string>& names) {
  const auto column = find_column(cloud, names);
  if (column && !is_integer(column->type)) {
    refuse("bad_field", "field " + names.front() + " has a floating-point datatype; it needs an " +
                            "integer one");
  }
  return column;
}

PointColumn coordinate(const PointCloud2& cloud, const std::vector<std::string>& names) {
  const auto column = find_column(cloud, names);
  if (!column) refuse("no_xyz", "there is no field " + names.front() + "; x, y and z are needed");
  return *column;
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
          .label = find_integer_column(cloud, names.label)};
}

}  // namespace

CheckedLayout check_layout(const PointCloud2& cloud, const PointFieldNames& names) {
  try {
    return {.layout = layout_of(cloud, names), .fault = {}};
  } catch (const Refusal& refusal) {
    return {.layout = std::nullopt, .fault = refusal.fault};
  }
}

}  // namespace stillmap::wire
