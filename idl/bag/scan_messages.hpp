#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/dataset/scan_source.hpp"
#include "core/geodesy/gnss_fix.hpp"
#include "core/inertial/imu_sample.hpp"
#include "core/lidar/label_kind.hpp"
#include "core/lidar/point_fields.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap::dds {

/// The messages of which scans can be made.
enum class ScanMessageType {
  /// sensor_msgs/msg/PointCloud2.
  point_cloud,
  /// velodyne_msgs/msg/VelodyneScan: the packets of one revolution.
  velodyne_packets,
  /// livox_ros_driver2/msg/CustomMsg (and livox_ros_driver's).
  livox_points,
};

/// By the ROS 2 name of its type; nothing for other types.
[[nodiscard]] std::optional<ScanMessageType> scan_message_type(std::string_view type);

struct DecodedScan {
  /// Intensity in the sensor's own numbers.
  DatasetFrame frame;
  /// Where the message says which it was.
  std::optional<SensorModel> sensor;
};

/// Makes a scan of a serialized message. Throws CdrError in words for bytes that are not such a
/// message, or give no scan. Raw labels are as the message has them, in a field of 8 bits only
/// where they are told to be classes. `fields`: the names of what a PointCloud2 has of a point.
[[nodiscard]] DecodedScan decode_scan(ScanMessageType kind, std::span<const std::uint8_t> message,
                                      LabelKind label_kind = LabelKind::semantic_kitti,
                                      const PointFieldNames& fields = {});

inline constexpr std::string_view imu_message_type = "sensor_msgs/msg/Imu";

/// Reads a serialized sensor_msgs/msg/Imu. Throws CdrError for bytes that are none.
[[nodiscard]] ImuSample decode_imu(std::span<const std::uint8_t> message);

inline constexpr std::string_view gnss_message_type = "sensor_msgs/msg/NavSatFix";

/// Reads a serialized sensor_msgs/msg/NavSatFix; nothing where the receiver had no fix, or none
/// that can be used. Throws CdrError for bytes that are none.
[[nodiscard]] std::optional<GnssFix> decode_gnss(std::span<const std::uint8_t> message);

/// The stamp of a message that begins with a std_msgs/Header; 12 bytes are enough. Nothing when
/// there is none.
[[nodiscard]] std::optional<std::int64_t> header_stamp_ns(std::span<const std::uint8_t> message);

/// The frame of such a message; nothing when the bytes do not reach to its end.
[[nodiscard]] std::optional<std::string> header_frame(std::span<const std::uint8_t> message);

}  // namespace stillmap::dds
