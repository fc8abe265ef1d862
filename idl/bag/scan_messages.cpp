#include "idl/bag/scan_messages.hpp"

#include <string>
#include <utility>
#include <vector>

#include "core/dataset/velodyne_packets.hpp"
#include "idl/bag/cdr_reader.hpp"
#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/conversions/gnss.hpp"
#include "sensor_msgs.h"

namespace stillmap::dds {
namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;
/// sec, nanosec.
constexpr std::size_t stamp_bytes = 8;

std::int64_t read_stamp_ns(CdrReader& cdr) {
  const auto seconds = cdr.value<std::int32_t>();
  const auto nanoseconds = cdr.value<std::uint32_t>();
  if (nanoseconds >= ns_per_s) {
    throw CdrError("a stamp has " + std::to_string(nanoseconds) + " ns, a second or more");
  }
  return seconds * ns_per_s + nanoseconds;
}

void read_header(CdrReader& cdr, std_msgs::msg::Header& header) {
  header.stamp().sec(cdr.value<std::int32_t>());
  header.stamp().nanosec(cdr.value<std::uint32_t>());
  header.frame_id(cdr.text());
}

sensor_msgs::msg::PointCloud2 read_cloud(CdrReader cdr) {
  sensor_msgs::msg::PointCloud2 cloud;
  read_header(cdr, cloud.header());
  cloud.height(cdr.value<std::uint32_t>());
  cloud.width(cdr.value<std::uint32_t>());
  // An empty name, three numbers.
  constexpr std::size_t field_bytes = 13;
  cloud.fields().resize(cdr.count(field_bytes));
  for (auto& field : cloud.fields()) {
    field.name(cdr.text());
    field.offset(cdr.value<std::uint32_t>());
    field.datatype(cdr.value<std::uint8_t>());
    field.count(cdr.value<std::uint32_t>());
  }
  cloud.is_bigendian(cdr.value<std::uint8_t>() != 0);
  cloud.point_step(cdr.value<std::uint32_t>());
  cloud.row_step(cdr.value<std::uint32_t>());
  const auto data = cdr.octets();
  cloud.data().assign(data.begin(), data.end());
  cloud.is_dense(cdr.value<std::uint8_t>() != 0);
  return cloud;
}

DecodedScan from_cloud(CdrReader cdr, LabelKind label_kind, const PointFieldNames& fields) {
  const sensor_msgs::msg::PointCloud2 cloud = read_cloud(cdr);
  wire::ScanFromCloud read =
      wire::to_scan(cloud, {.fields = fields,
                            .labels_are_classes = label_kind == LabelKind::classes,
                            .keeps_raw_labels = true});
  if (!read.scan) throw CdrError(read.fault.reason);
  return {.frame = {.scan = *std::move(read.scan),
                    .raw_labels = std::move(read.raw_labels),
                    .format = std::move(read.format)},
          .sensor = {}};
}

DecodedScan from_velodyne_packets(CdrReader cdr) {
  const std::int64_t stamp_ns = read_stamp_ns(cdr);
  (void)cdr.text();
  std::vector<VelodynePacket> packets(cdr.count(stamp_bytes + velodyne_packet_bytes));
  for (VelodynePacket& packet : packets) {
    packet.stamp_ns = read_stamp_ns(cdr);
    packet.bytes = cdr.take(velodyne_packet_bytes);
  }
  VelodyneDecoding decoding = decode_velodyne(packets, stamp_ns);
  if (decoding.scan.empty()) {
    throw CdrError(decoding.fault.empty()
                       ? "its " + std::to_string(packets.size()) + " packets hold no point"
                       : decoding.fault);
  }
  return {.frame = {.scan = std::move(decoding.scan), .raw_labels = {}, .format = {}},
          .sensor = std::move(decoding.sensor)};
}

DecodedScan from_livox(CdrReader cdr) {
  DecodedScan read;
  Scan& scan = read.frame.scan;
  scan.stamp_ns = read_stamp_ns(cdr);
  (void)cdr.text();
  (void)cdr.value<std::uint64_t>();  // timebase: the stamp again
  (void)cdr.value<std::uint32_t>();  // point_num: the sequence's length again
  (void)cdr.take(4);                 // lidar_id, rsvd
  constexpr std::size_t point_bytes = 19;
  const std::size_t points = cdr.count(point_bytes);
  for (std::size_t i = 0; i < points; ++i) {
    scan.time_offset_s.push_back(1e-9F * static_cast<float>(cdr.value<std::uint32_t>()));
    const auto x = cdr.value<float>();
    const auto y = cdr.value<float>();
    scan.points_lidar.emplace_back(x, y, cdr.value<float>());
    scan.intensity.push_back(cdr.value<std::uint8_t>());
    (void)cdr.take(2);  // tag, line
  }
  return read;
}

}  // namespace

std::optional<ScanMessageType> scan_message_type(std::string_view type) {
  if (type == "sensor_msgs/msg/PointCloud2") return ScanMessageType::point_cloud;
  if (type == "velodyne_msgs/msg/VelodyneScan") return ScanMessageType::velodyne_packets;
  if (type == "livox_ros_driver2/msg/CustomMsg" || type == "livox_interfaces/msg/CustomMsg" ||
      type == "livox_ros_driver/msg/CustomMsg") {
    return ScanMessageType::livox_points;
  }
  return std::nullopt;
}

DecodedScan decode_scan(ScanMessageType kind, std::span<const std::uint8_t> message,
                        LabelKind label_kind, const PointFieldNames& fields) {
  const CdrReader cdr(message);
  switch (kind) {
    case ScanMessageType::point_cloud:
      return from_cloud(cdr, label_kind, fields);
    case ScanMessageType::velodyne_packets:
      return from_velodyne_packets(cdr);
    case ScanMessageType::livox_points:
      return from_livox(cdr);
  }
  throw CdrError("it is of a kind that is not known");
}

ImuSample decode_imu(std::span<const std::uint8_t> message) {
  CdrReader cdr(message);
  ImuSample sample;
  sample.stamp_ns = read_stamp_ns(cdr);
  (void)cdr.text();
  const auto skip = [&cdr](int values) {
    for (int k = 0; k < values; ++k) (void)cdr.value<double>();
  };
  const auto vector = [&cdr] {
    const auto x = cdr.value<double>();
    const auto y = cdr.value<double>();
    return Eigen::Vector3d(x, y, cdr.value<double>());
  };
  constexpr int orientation = 4;
  constexpr int covariance = 9;
  skip(orientation + covariance);
  sample.angular_velocity_imu = vector();
  skip(covariance);
  sample.acceleration_imu = vector();
  skip(covariance);
  return sample;
}

std::optional<GnssFix> decode_gnss(std::span<const std::uint8_t> message) {
  CdrReader cdr(message);
  sensor_msgs::msg::NavSatFix fix;
  read_header(cdr, fix.header());
  fix.status().status(cdr.value<std::uint8_t>());
  fix.status().service(cdr.value<std::uint16_t>());
  fix.latitude(cdr.value<double>());
  fix.longitude(cdr.value<double>());
  fix.altitude(cdr.value<double>());
  for (double& value : fix.position_covariance()) value = cdr.value<double>();
  fix.position_covariance_type(cdr.value<std::uint8_t>());
  return wire::from_nav_sat_fix(fix).fix;
}

std::optional<std::int64_t> header_stamp_ns(std::span<const std::uint8_t> message) {
  try {
    CdrReader cdr(message);
    return read_stamp_ns(cdr);
  } catch (const CdrError&) {
    return std::nullopt;
  }
}

std::optional<std::string> header_frame(std::span<const std::uint8_t> message) {
  try {
    CdrReader cdr(message);
    (void)read_stamp_ns(cdr);
    return std::string(cdr.text());
  } catch (const CdrError&) {
    return std::nullopt;
  }
}

}  // namespace stillmap::dds
