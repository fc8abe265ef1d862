#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// Bytes of a data packet, without the headers of UDP.
inline constexpr std::size_t velodyne_packet_bytes = 1206;

/// A data packet as it came from the network.
struct VelodynePacket {
  /// When the host received it, nanoseconds since the Unix epoch; 0 when not known.
  std::int64_t stamp_ns = 0;
  std::span<const std::uint8_t> bytes;
};

struct VelodyneDecoding {
  /// Intensity as the sensor counts it, 0..255; ring 0 is the lowest beam, as in Velodyne's
  /// drivers.
  Scan scan;
  /// Of the first packet that says which sensor sent it.
  std::optional<SensorModel> sensor;
  std::size_t damaged_packets = 0;
  /// Why the last of them could not be used, with the way out.
  std::string fault;
};

/// Points of a VLP-16 (Puck, Puck LITE) or HDL-32E from their packets, in order of firing: every
/// point has its azimuth at its own moment and, as time, the packet's own clock (microseconds of
/// the hour) from the first packet on, which stands at its stamp relative to `stamp_ns`. With dual
/// return, the second return of a firing is a point of its own where it differs from the first.
/// Beams that saw nothing give no point. Any input is fine: packets that cannot be used are counted
/// and left out.
///
/// Angles, distances and firing times are those of the user manuals (VLP-16: 63-9243, HDL-32E:
/// 63-9113); the 1 cm by which the beams start at different heights is left out, as in other
/// decoders.
[[nodiscard]] VelodyneDecoding decode_velodyne(std::span<const VelodynePacket> packets,
                                               std::int64_t stamp_ns);

}  // namespace stillmap
