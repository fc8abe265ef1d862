#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/lidar/scan.hpp"
#include "idl/bag/bag_writer.hpp"
#include "idl/conversions/to_cloud.hpp"
#include "sensor_msgs.h"

namespace stillmap::dds {

using Bytes = std::vector<std::uint8_t>;

/// What Fast DDS puts on the wire: an encoder that is not ours.
template <typename Message>
Bytes serialized(const Message& message, bool little_endian = true) {
  eprosima::fastcdr::FastBuffer buffer;
  eprosima::fastcdr::Cdr cdr(buffer,
                             little_endian ? eprosima::fastcdr::Cdr::LITTLE_ENDIANNESS
                                           : eprosima::fastcdr::Cdr::BIG_ENDIANNESS,
                             eprosima::fastcdr::Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  message.serialize(cdr);
  const auto* begin = reinterpret_cast<const std::uint8_t*>(buffer.getBuffer());
  return {begin, begin + cdr.getSerializedDataLength()};
}

/// Scan number `k` of a small recording: ten points, 0.1 s apart.
inline Scan bag_scan(int k) {
  Scan scan;
  scan.stamp_ns = 1'700'000'000'000'000'000 + k * std::int64_t{100'000'000};
  for (int i = 0; i < 10; ++i) {
    scan.points_lidar.emplace_back(static_cast<float>(i + 1), static_cast<float>(k), -1.0F);
    scan.intensity.push_back(0.05F * static_cast<float>(i));
    scan.time_offset_s.push_back(0.01F * static_cast<float>(i));
    scan.ring.push_back(static_cast<std::uint16_t>(i));
  }
  return scan;
}

inline Bytes bag_message(int k, bool little_endian = true) {
  return serialized(wire::to_cloud(bag_scan(k), {}, "lidar"), little_endian);
}

inline BagTopic cloud_topic(const std::string& name) {
  return {.name = name,
          .type = "sensor_msgs/msg/PointCloud2",
          .serialization_format = "cdr",
          .offered_qos_profiles = offered_qos_yaml(true, false, 10),
          .messages = 0};
}

/// A bag with these messages on /points.
inline void write_bag(const std::filesystem::path& folder, const std::vector<Bytes>& messages,
                      BagFormat format = BagFormat::sqlite,
                      mcap::Compression compression = mcap::Compression::none) {
  BagWriter writer(folder, {cloud_topic("/points")}, format, compression);
  std::int64_t received_ns = 1'700'000'000'050'000'000;
  for (const Bytes& message : messages) writer.add(0, received_ns += 100'000'000, message);
  writer.finish();
}

}  // namespace stillmap::dds
