#include "tests/ros/cyclone_peer/lidar.hpp"

#include <algorithm>
#include <fstream>
#include <iterator>

namespace stillmap::peer {
namespace {

using Field = sensor_msgs_msg_dds__PointField_;
using Stamp = builtin_interfaces_msg_dds__Time_;

constexpr std::size_t recorded_point_bytes = 16;
constexpr std::size_t label_bytes = 4;

std::vector<std::uint8_t> content(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw std::runtime_error("cannot read " + file.string());
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// x y z intensity of the recording, then its label, for each point.
std::vector<std::uint8_t> with_labels(const std::vector<std::uint8_t>& points,
                                      const std::vector<std::uint8_t>& labels) {
  const std::size_t count = points.size() / recorded_point_bytes;
  if (labels.size() != count * label_bytes) throw std::runtime_error("labels do not fit the scan");
  std::vector<std::uint8_t> data;
  data.reserve(points.size() + labels.size());
  for (std::size_t i = 0; i < count; ++i) {
    const auto* const point = points.data() + i * recorded_point_bytes;
    const auto* const label = labels.data() + i * label_bytes;
    data.insert(data.end(), point, point + recorded_point_bytes);
    data.insert(data.end(), label, label + label_bytes);
  }
  return data;
}

/// Four bytes each; the last is an unsigned number.
std::array<Field, 5> fields_named(std::array<std::string, 5>& names) {
  constexpr std::uint8_t uint32 = 6;
  constexpr std::uint8_t float32 = 7;
  std::array<Field, 5> fields{};
  for (std::uint32_t i = 0; i < fields.size(); ++i) {
    fields[i] = {
        .name = names[i].data(), .offset = 4 * i, .datatype = i < 4 ? float32 : uint32, .count = 1};
  }
  return fields;
}

/// Scans are a tenth of a second apart.
Stamp stamp_of(std::size_t scan) {
  return {.sec = static_cast<std::int32_t>(1'700'000'000 + scan / 10),
          .nanosec = static_cast<std::uint32_t>(scan % 10) * 100'000'000U};
}

}  // namespace

Lidar::Lidar(const Participant& participant, const std::filesystem::path& recording)
    : recording_(recording),
      fields_(fields_named(field_names_)),
      writer_(participant, "rt/points", {.depth = 1, .keep_all = true}) {
  for (const auto& entry : std::filesystem::directory_iterator(recording / "velodyne")) {
    names_.push_back(entry.path().stem());
  }
  std::ranges::sort(names_);
}

void Lidar::publish(std::size_t scan) {
  std::filesystem::path points = recording_ / "velodyne" / names_[scan];
  std::filesystem::path labels = recording_ / "labels" / names_[scan];
  auto data = with_labels(content(points += ".bin"), content(labels += ".label"));
  std::string frame = "velodyne";
  Cloud cloud{};
  cloud.header.stamp = stamp_of(scan);
  cloud.header.frame_id = frame.data();
  cloud.height = 1;
  cloud.point_step = recorded_point_bytes + label_bytes;
  cloud.row_step = static_cast<std::uint32_t>(data.size());
  cloud.width = cloud.row_step / cloud.point_step;
  cloud.is_dense = true;
  lend(cloud.fields, fields_);
  lend(cloud.data, data);
  writer_.write(cloud);
}

}  // namespace stillmap::peer
