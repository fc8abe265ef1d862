#include "core/dataset/velodyne_packets.hpp"

#include <array>
#include <cmath>
#include <utility>

#include "core/lidar/angle_units.hpp"

namespace stillmap {
namespace {

constexpr std::size_t blocks = 12;
constexpr std::size_t block_bytes = 100;
constexpr std::size_t channels = 32;
constexpr double metres_per_count = 0.002;
constexpr int full_turn = 36000;
/// A head that turns at 20 Hz moves by 80 hundredths of a degree in a VLP-16's block; beyond this
/// lies a gap, where packets or a sector are missing.
constexpr int max_step = 200;
constexpr std::int64_t us_an_hour = 3'600'000'000;
/// The host's and the sensor's clock differ by less within a scan, or one of them was set.
constexpr std::int64_t max_scan_us = 5'000'000;
/// Where a packet says how returns are sent, and which sensor it is.
constexpr std::size_t time_at = 1200, return_mode_at = 1204, product_at = 1205;
constexpr std::uint8_t dual_return = 0x39;

/// How a sensor fires.
struct Model {
  SensorModel sensor;
  std::size_t lasers;
  /// From one laser to the next, from one firing of all to the next, and a whole block [us].
  double laser_us, firing_us, block_us;
  /// Elevation and ring of each laser, in order of firing.
  std::array<double, channels> elevation;
  std::array<std::uint16_t, channels> ring;
};

/// Lasers fire from the lower and the upper half in turn.
Model model_of(SensorModel sensor, double laser_us, double firing_us, double block_us) {
  Model model{std::move(sensor), 0, laser_us, firing_us, block_us, {}, {}};
  model.lasers = static_cast<std::size_t>(model.sensor.rings);
  for (std::size_t laser = 0; laser < model.lasers; ++laser) {
    const std::size_t ring = laser / 2 + (laser % 2) * model.lasers / 2;
    model.ring[laser] = static_cast<std::uint16_t>(ring);
    const auto from_top = static_cast<int>(model.lasers - 1 - ring);
    model.elevation[laser] = model.sensor.beam_elevation(from_top);
  }
  return model;
}

std::optional<Model> model_of_product(std::uint8_t product) {
  if (product == 0x22) return model_of(vlp_16(), 2.304, 55.296, 110.592);
  if (product == 0x21) return model_of(hdl_32e(), 1.152, 46.080, 46.080);
  return std::nullopt;
}

int uint16_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  return bytes[at] | bytes[at + 1] << 8;
}

std::int64_t time_of_hour_us(std::span<const std::uint8_t> bytes) {
  std::int64_t time_us = 0;
  for (std::size_t i = 0; i < 4; ++i) time_us |= std::int64_t{bytes[time_at + i]} << (8 * i);
  return time_us;
}

std::string hexadecimal(std::uint8_t value) {
  constexpr std::string_view digits = "0123456789abcdef";
  return std::string("0x") + digits[value >> 4U] + digits[value & 0xFU];
}

/// Why a packet cannot be used; empty when it can.
std::string fault_of(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != velodyne_packet_bytes) {
    return "a packet has " + std::to_string(bytes.size()) + " bytes; a data packet has 1206";
  }
  for (std::size_t block = 0; block < blocks; ++block) {
    if (uint16_at(bytes, block * block_bytes) != 0xEEFF) {
      return "block " + std::to_string(block) + " of a packet begins with " +
             hexadecimal(bytes[block * block_bytes]) + " and not with ff ee";
    }
    if (uint16_at(bytes, block * block_bytes + 2) >= full_turn) {
      return "block " + std::to_string(block) + " of a packet has no azimuth below 360 degrees";
    }
  }
  if (!model_of_product(bytes[product_at])) {
    return "a packet is from product " + hexadecimal(bytes[product_at]) +
           "; only a VLP-16 (0x22) and an HDL-32E (0x21) are decoded: record the PointCloud2 of "
           "its driver instead";
  }
  return {};
}

/// Hundredths of a degree from azimuth `a` on to `b`.
int step_between(int a, int b) { return (b - a + full_turn) % full_turn; }

class Decoder {
 public:
  explicit Decoder(std::int64_t stamp_ns) { decoding_.scan.stamp_ns = stamp_ns; }

  void add(const VelodynePacket& packet) {
    if (std::string fault = fault_of(packet.bytes); !fault.empty()) {
      ++decoding_.damaged_packets;
      decoding_.fault = std::move(fault);
      return;
    }
    if (!model_ || product_ != packet.bytes[product_at]) {
      product_ = packet.bytes[product_at];
      model_ = model_of_product(product_);
      if (!decoding_.sensor) decoding_.sensor = model_->sensor;
    }
    const double begin_s = begin_of(packet);
    const bool dual = packet.bytes[return_mode_at] == dual_return;
    for (std::size_t block = 0; block < blocks; ++block) {
      add_block(packet.bytes, block, dual, begin_s);
    }
  }

  [[nodiscard]] VelodyneDecoding take() { return std::move(decoding_); }

 private:
  /// The packet's time relative to the scan's stamp.
  double begin_of(const VelodynePacket& packet) {
    const std::int64_t time_us = time_of_hour_us(packet.bytes);
    if (!first_us_) {
      first_us_ = time_us;
      const std::int64_t from_stamp_us = (packet.stamp_ns - decoding_.scan.stamp_ns) / 1000;
      if (packet.stamp_ns != 0 && std::abs(from_stamp_us) < max_scan_us) {
        first_from_stamp_us_ = from_stamp_us;
      }
      first_host_ns_ = packet.stamp_ns;
    }
    std::int64_t passed_us = (time_us - *first_us_) % us_an_hour;
    if (passed_us < -us_an_hour / 2) passed_us += us_an_hour;
    // The sensor's clock was set in the middle of a scan.
    if (std::abs(passed_us) > max_scan_us) {
      passed_us = (packet.stamp_ns - first_host_ns_) / 1000;
    }
    return 1e-6 * static_cast<double>(first_from_stamp_us_ + passed_us);
  }

  /// How far the head turns during a block; as in the one before where it cannot be seen.
  double azimuth_step(std::span<const std::uint8_t> bytes, std::size_t block, bool dual) {
    const std::size_t next = block + (dual ? 2 : 1);
    if (next < blocks) {
      const int step = step_between(uint16_at(bytes, block * block_bytes + 2),
                                    uint16_at(bytes, next * block_bytes + 2));
      if (step <= max_step) last_step_ = step;
    }
    return last_step_;
  }

  void add_block(std::span<const std::uint8_t> bytes, std::size_t block, bool dual,
                 double packet_s) {
    const std::size_t at = block * block_bytes;
    const double azimuth = uint16_at(bytes, at + 2);
    const double step = azimuth_step(bytes, block, dual);
    const double begin_us = static_cast<double>(dual ? block / 2 : block) * model_->block_us;
    for (std::size_t channel = 0; channel < channels; ++channel) {
      const std::size_t value_at = at + 4 + 3 * channel;
      const int count = uint16_at(bytes, value_at);
      // With dual return, blocks come in pairs of one moment; one return stands in both.
      const bool twice =
          dual && block % 2 == 1 && count == uint16_at(bytes, value_at - block_bytes);
      if (count == 0 || twice) continue;
      const std::size_t laser = channel % model_->lasers;
      const double fired_us = static_cast<double>(channel / model_->lasers) * model_->firing_us +
                              static_cast<double>(laser) * model_->laser_us;
      const double angle = 0.01 * rad_per_deg * (azimuth + step * fired_us / model_->block_us);
      add_point(laser, metres_per_count * count, angle, bytes[value_at + 2]);
      decoding_.scan.time_offset_s.push_back(
          static_cast<float>(packet_s + 1e-6 * (begin_us + fired_us)));
    }
  }

  /// `angle` runs clockwise from the sensor's y axis, which is our x.
  void add_point(std::size_t laser, double range_m, double angle, std::uint8_t reflectivity) {
    const double elevation = model_->elevation[laser];
    const double across = range_m * std::cos(elevation);
    decoding_.scan.points_lidar.emplace_back(Eigen::Vector3d(across * std::cos(angle),
                                                             -across * std::sin(angle),
                                                             range_m * std::sin(elevation))
                                                 .cast<float>());
    decoding_.scan.intensity.push_back(reflectivity);
    decoding_.scan.ring.push_back(model_->ring[laser]);
  }

  VelodyneDecoding decoding_;
  std::optional<Model> model_;
  std::uint8_t product_ = 0;
  std::optional<std::int64_t> first_us_;
  std::int64_t first_host_ns_ = 0;
  std::int64_t first_from_stamp_us_ = 0;
  /// Of a head at 10 Hz, before it is seen.
  int last_step_ = 40;
};

}  // namespace

VelodyneDecoding decode_velodyne(std::span<const VelodynePacket> packets, std::int64_t stamp_ns) {
  Decoder decoder(stamp_ns);
  for (const VelodynePacket& packet : packets) decoder.add(packet);
  return decoder.take();
}

}  // namespace stillmap
