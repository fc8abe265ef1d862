// A number that says which message, then it as a bag keeps it: PointCloud2, a Velodyne's packets
// (serialized, or as they come from the sensor), Livox's points, an IMU's sample.

#include "core/dataset/velodyne_packets.hpp"
#include "idl/bag/cdr_reader.hpp"
#include "idl/bag/scan_messages.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/idl/bag_fixture.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace bag_message_inputs {
namespace {

enum Kind : std::uint8_t { cloud, velodyne_scan, livox, packets, imu, kinds };

void check_scan(const Scan& scan) {
  const auto fits = [&](const auto& values) {
    return values.empty() || values.size() == scan.size();
  };
  require(fits(scan.intensity) && fits(scan.time_offset_s) && fits(scan.ring) && fits(scan.labels),
          "every list of a scan is empty or as long as its points");
}

void decode_packets(ByteSource& source) {
  std::vector<VelodynePacket> received;
  while (!source.empty()) {
    const auto stamp_ns = std::int64_t{source.value<std::int32_t>()};
    received.push_back({stamp_ns, source.take(velodyne_packet_bytes)});
  }
  check_scan(decode_velodyne(received, 1'700'000'000'000'000'000).scan);
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const auto kind = static_cast<Kind>(source.byte() % kinds);
  if (kind == packets) return decode_packets(source);
  const Bytes message = source.rest();
  static_cast<void>(dds::header_stamp_ns(message));
  try {
    if (kind == imu) return static_cast<void>(dds::decode_imu(message));
    check_scan(dds::decode_scan(static_cast<dds::ScanMessageType>(kind), message).frame.scan);
  } catch (const dds::CdrError&) {
  }
}

/// A VLP-16's packet whose twelve blocks all see something.
std::string packet_bytes() {
  std::string bytes(velodyne_packet_bytes, '\x20');
  for (std::size_t block = 0; block < 12; ++block) {
    const std::size_t at = block * 100;
    bytes.replace(at, 2, "\xff\xee");
    const auto azimuth = static_cast<std::uint16_t>(40 * block);
    bytes[at + 2] = static_cast<char>(azimuth & 0xffU);
    bytes[at + 3] = static_cast<char>(azimuth >> 8U);
  }
  bytes[1204] = '\x37';
  bytes[1205] = '\x22';
  return bytes;
}

/// Encapsulation, stamp, an empty frame name.
std::string header_bytes() {
  std::string bytes("\0\1\0\0", 4);
  append_value(bytes, std::int32_t{1'700'000'000});
  append_value(bytes, std::uint32_t{5});
  append_value(bytes, std::uint32_t{1});
  return bytes.append(4, '\0');
}

std::string velodyne_bytes() {
  std::string bytes = header_bytes();
  append_value(bytes, std::uint32_t{1});
  append_value(bytes, std::int32_t{1'700'000'000});
  append_value(bytes, std::uint32_t{7});
  return bytes + packet_bytes();
}

std::string livox_bytes() {
  std::string bytes = header_bytes();
  append_value(bytes, std::uint32_t{0});  // aligns what follows
  append_value(bytes, std::uint64_t{9});
  append_value(bytes, std::uint32_t{2});
  append_value(bytes, std::uint32_t{0});
  append_value(bytes, std::uint32_t{2});
  for (int point = 0; point < 2; ++point) {
    append_value(bytes, std::uint32_t{100});
    for (const float value : {1.0F, 2.0F, 3.0F}) append_value(bytes, value);
    bytes.append("\x40\0\0\0", 4);
  }
  return bytes;
}

std::vector<Seed> seeds() {
  std::string received;
  append_value(received, std::int32_t{100});
  received += packet_bytes();
  return {{"cloud", with_choice(cloud, text_of(dds::bag_message(0)))},
          {"cloud_big_endian", with_choice(cloud, text_of(dds::bag_message(1, false)))},
          {"velodyne", with_choice(velodyne_scan, velodyne_bytes())},
          {"livox", with_choice(livox, livox_bytes())},
          {"packets", with_choice(packets, received + received)}};
}

}  // namespace
}  // namespace bag_message_inputs

const Target bag_message_target{"bag_message", bag_message_inputs::run, bag_message_inputs::seeds};

}  // namespace stillmap::fuzz
