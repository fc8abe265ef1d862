#include "core/dataset/velodyne_packets.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>

namespace stillmap {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr double degree = std::numbers::pi / 180.0;
constexpr std::int64_t stamp_ns = 1'700'000'000'000'000'000;
constexpr std::uint8_t vlp = 0x22, hdl_32 = 0x21;
constexpr std::uint8_t strongest = 0x37, dual = 0x39;

using Bytes = std::vector<std::uint8_t>;

void put(Bytes& bytes, std::size_t at, std::uint32_t value, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i)
    bytes[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
}

/// Twelve blocks from `azimuth` on, `step` apart (hundredths of a degree), without any return.
Bytes empty_packet(std::uint8_t product, std::uint8_t mode, std::uint32_t time_us,
                   std::uint32_t azimuth, std::uint32_t step) {
  Bytes bytes(velodyne_packet_bytes, 0);
  for (std::size_t block = 0; block < 12; ++block) {
    put(bytes, block * 100, 0xEEFF, 2);
    const std::size_t moment = mode == dual ? block / 2 : block;
    put(bytes, block * 100 + 2, (azimuth + step * static_cast<std::uint32_t>(moment)) % 36000, 2);
  }
  put(bytes, 1200, time_us, 4);
  bytes[1204] = mode;
  bytes[1205] = product;
  return bytes;
}

void put_return(Bytes& bytes, std::size_t block, std::size_t channel, double range_m,
                std::uint8_t reflectivity) {
  put(bytes, block * 100 + 4 + 3 * channel, static_cast<std::uint32_t>(range_m / 0.002), 2);
  bytes[block * 100 + 4 + 3 * channel + 2] = reflectivity;
}

VelodyneDecoding decode(const std::vector<Bytes>& packets, std::int64_t host_stamp_ns = stamp_ns) {
  std::vector<VelodynePacket> received;
  for (const Bytes& bytes : packets) received.push_back({host_stamp_ns, bytes});
  return decode_velodyne(received, stamp_ns);
}

double azimuth_deg(const Eigen::Vector3f& p) {
  const double clockwise = -std::atan2(p.y(), p.x()) / degree;
  return clockwise < 0.0 ? clockwise + 360.0 : clockwise;
}
double measured_deg(const Eigen::Vector3f& p) {
  return std::atan2(p.z(), std::hypot(p.x(), p.y())) / degree;
}

TEST(VelodynePackets, ABeamAheadIsOnTheXAxisAndClockwiseIsTowardsMinusY) {
  Bytes packet = empty_packet(vlp, strongest, 0, 0, 0);
  // Laser 1 looks up by 1 degree.
  put_return(packet, 0, 1, 10.0, 200);
  Bytes right = empty_packet(vlp, strongest, 0, 9000, 0);
  put_return(right, 0, 1, 10.0, 100);
  const VelodyneDecoding decoding = decode({packet, right});
  ASSERT_EQ(decoding.scan.size(), 2U);
  const auto& points = decoding.scan.points_lidar;
  EXPECT_LT((points[0] - Eigen::Vector3f(9.99848F, 0.0F, 0.174524F)).norm(), 1e-4F);
  EXPECT_LT((points[1] - Eigen::Vector3f(0.0F, -9.99848F, 0.174524F)).norm(), 1e-4F);
  EXPECT_THAT(decoding.scan.intensity, testing::ElementsAre(200.0F, 100.0F));
  EXPECT_EQ(decoding.sensor->name, "VLP-16");
}

/// The manuals' tables, in order of firing.
struct FiringCase {
  std::uint8_t product;
  const char* sensor;
  std::vector<double> elevations_deg;
  double laser_us, firing_us, block_us;
};

class VelodyneFiring : public testing::TestWithParam<FiringCase> {};

TEST_P(VelodyneFiring, FollowsTheManual) {
  const FiringCase& model = GetParam();
  const std::size_t lasers = model.elevations_deg.size();
  constexpr double step_deg = 0.4;
  Bytes packet = empty_packet(model.product, strongest, 1'000'000, 35'900, 40);
  for (std::size_t block = 0; block < 12; ++block) {
    for (std::size_t channel = 0; channel < 32; ++channel) {
      put_return(packet, block, channel, 20.0, static_cast<std::uint8_t>(channel));
    }
  }
  const VelodyneDecoding decoding = decode({packet}, stamp_ns + 5'000'000);
  const Scan& scan = decoding.scan;
  ASSERT_EQ(scan.size(), 12U * 32U);
  EXPECT_EQ(decoding.sensor->name, model.sensor);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const std::size_t block = i / 32, channel = i % 32, laser = channel % lasers;
    const double in_block_us = static_cast<double>(channel / lasers) * model.firing_us +
                               static_cast<double>(laser) * model.laser_us;
    const double expected_deg =
        359.0 + step_deg * static_cast<double>(block) + step_deg * in_block_us / model.block_us;
    EXPECT_NEAR(measured_deg(scan.points_lidar[i]), model.elevations_deg[laser], 0.005) << i;
    EXPECT_NEAR(std::remainder(azimuth_deg(scan.points_lidar[i]) - expected_deg, 360.0), 0.0, 1e-3);
    EXPECT_NEAR(scan.time_offset_s[i],
                0.005 + 1e-6 * (static_cast<double>(block) * model.block_us + in_block_us), 1e-8);
    // Rings count from below.
    const auto below = std::ranges::count_if(
        model.elevations_deg, [&](double other) { return other < model.elevations_deg[laser]; });
    EXPECT_EQ(scan.ring[i], below);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, VelodyneFiring,
    testing::Values(FiringCase{vlp,
                               "VLP-16",
                               {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15},
                               2.304,
                               55.296,
                               110.592},
                    FiringCase{hdl_32,
                               "HDL-32E",
                               {-30.67, -9.33, -29.33, -8.00, -28.00, -6.67, -26.67, -5.33,
                                -25.33, -4.00, -24.00, -2.67, -22.67, -1.33, -21.33, 0.00,
                                -20.00, 1.33,  -18.67, 2.67,  -17.33, 4.00,  -16.00, 5.33,
                                -14.67, 6.67,  -13.33, 8.00,  -12.00, 9.33,  -10.67, 10.67},
                               1.152,
                               46.080,
                               46.080}),
    [](const auto& info) { return info.index == 0 ? "Vlp16" : "Hdl32E"; });

TEST(VelodynePackets, DualReturnGivesASecondPointWhereThereIsOne) {
  Bytes packet = empty_packet(vlp, dual, 0, 1000, 40);
  // A pair of blocks is one moment: here two returns, there the same one twice.
  put_return(packet, 0, 3, 20.0, 10);
  put_return(packet, 1, 3, 12.0, 20);
  put_return(packet, 2, 3, 20.0, 30);
  put_return(packet, 3, 3, 20.0, 30);
  const Scan scan = decode({packet}).scan;
  EXPECT_THAT(scan.intensity, testing::ElementsAre(10.0F, 20.0F, 30.0F));
  EXPECT_EQ(scan.time_offset_s[0], scan.time_offset_s[1]);
  EXPECT_NEAR(scan.time_offset_s[2] - scan.time_offset_s[0], 110.592e-6, 1e-9);
  EXPECT_NEAR(azimuth_deg(scan.points_lidar[2]) - azimuth_deg(scan.points_lidar[0]), 0.4, 1e-3);
}

TEST(VelodynePackets, TheSensorsClockGoesThroughTheFullHour) {
  Bytes before = empty_packet(vlp, strongest, 3'599'999'500, 0, 40);
  Bytes after = empty_packet(vlp, strongest, 827, 480, 40);
  put_return(before, 0, 0, 5.0, 1);
  put_return(after, 0, 0, 5.0, 1);
  const Scan scan = decode({before, after}).scan;
  ASSERT_EQ(scan.size(), 2U);
  EXPECT_NEAR(scan.time_offset_s[1] - scan.time_offset_s[0], 1327e-6, 1e-8);
}

TEST(VelodynePackets, AClockThatIsSetInTheMiddleIsReplacedByTheHosts) {
  Bytes before = empty_packet(vlp, strongest, 100, 0, 40);
  Bytes after = empty_packet(vlp, strongest, 1'800'000'000, 480, 40);
  put_return(before, 0, 0, 5.0, 1);
  put_return(after, 0, 0, 5.0, 1);
  const std::vector<VelodynePacket> packets = {{stamp_ns, before}, {stamp_ns + 1'300'000, after}};
  const Scan scan = decode_velodyne(packets, stamp_ns).scan;
  EXPECT_NEAR(scan.time_offset_s[1] - scan.time_offset_s[0], 0.0013, 1e-8);
}

TEST(VelodynePackets, ASectorThatIsMissingDoesNotBendTheBeams) {
  // From 10 to 50 degrees nothing was sent: the head still turned by 0.4 degrees a block.
  Bytes packet = empty_packet(vlp, strongest, 0, 1000, 40);
  for (std::size_t block = 6; block < 12; ++block) {
    put(packet, block * 100 + 2, 5000 + 40 * static_cast<std::uint32_t>(block), 2);
  }
  put_return(packet, 5, 31, 10.0, 1);
  const Scan scan = decode({packet}).scan;
  const double moved_deg = 0.4 * (55.296 + 15 * 2.304) / 110.592;
  EXPECT_NEAR(azimuth_deg(scan.points_lidar.at(0)), 12.0 + moved_deg, 1e-3);
}

TEST(VelodynePackets, DamagedPacketsAreCountedAndLeftOut) {
  Bytes good = empty_packet(vlp, strongest, 0, 0, 40);
  put_return(good, 0, 0, 5.0, 1);
  Bytes no_flag = good, no_azimuth = good, other_product = good, dark = good;
  no_flag[300] = 0;
  put(no_azimuth, 2, 36'000, 2);
  other_product[1205] = 0x28;
  const auto fault_of = [&](const Bytes& bad) {
    const VelodyneDecoding decoding = decode({bad, good});
    EXPECT_EQ(decoding.damaged_packets, 1U);
    EXPECT_EQ(decoding.scan.size(), 1U);
    return decoding.fault;
  };
  EXPECT_THAT(fault_of(no_flag), HasSubstr("block 3"));
  EXPECT_THAT(fault_of(no_azimuth), HasSubstr("azimuth"));
  EXPECT_THAT(fault_of(other_product), HasSubstr("0x28"));
  EXPECT_THAT(fault_of(Bytes(554, 1)), HasSubstr("554 bytes"));
  EXPECT_THAT(fault_of({}), HasSubstr("0 bytes"));
  EXPECT_THAT(decode({good}).fault, IsEmpty());
  EXPECT_TRUE(decode({}).scan.empty());
}

TEST(VelodynePackets, AnyBytesGiveScansThatAreInOrder) {
  std::mt19937 random(9);
  for (int round = 0; round < 500; ++round) {
    Bytes packet = empty_packet(round % 2 == 0 ? vlp : hdl_32, round % 3 == 0 ? dual : strongest,
                                static_cast<std::uint32_t>(random()), 0, 40);
    for (std::size_t i = 0; i < 400; ++i) {
      const std::size_t at = random() % packet.size();
      if (at % 100 > 3 || at >= 1200) packet[at] = static_cast<std::uint8_t>(random());
    }
    const Scan scan = decode({packet, packet}).scan;
    ASSERT_EQ(scan.time_offset_s.size(), scan.size());
    ASSERT_EQ(scan.ring.size(), scan.size());
    for (const auto& p : scan.points_lidar) ASSERT_LT(p.norm(), 132.0F);
  }
}

}  // namespace
}  // namespace stillmap
