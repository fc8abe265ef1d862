#include <gmock/gmock.h>

#include <limits>

#include "idl/conversions/to_cloud.hpp"
#include "idl/dds/serialized_sample.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using sensor_msgs::msg::PointCloud2;

class HostileInput : public testing::Test {
 protected:
  HostileInput() : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    EXPECT_TRUE(clouds_.readers().wait_for_any(patience));
  }

  void send(const PointCloud2& cloud) {
    ASSERT_TRUE(eventually([&] { return clouds_.write(cloud); }));
    ++sent_;
  }
  void send(const Scan& scan) { send(wire::to_cloud(scan, {}, "lidar")); }

  /// After the server dealt with everything sent.
  dds::ServerStatus status() {
    EXPECT_TRUE(wait_for_scans(client_, sent_));
    return client_.status();
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
  dds::Participant participant_{setup_.dds()};
  dds::TopicSpec<PointCloud2> topic_ = dds::points_topic("points", DeliveryMode::every, 4);
  dds::Writer<PointCloud2> clouds_{participant_, topic_.dds_name, topic_.writer};
  std::uint64_t sent_ = 0;
};

TEST_F(HostileInput, BadCloudsAreCountedAndServiceGoesOn) {
  send(room_scan(0));
  EXPECT_EQ(status().counter("scans_mapped"), 1U);
  PointCloud2 cloud = wire::to_cloud(room_scan(1), {}, "lidar");
  PointCloud2 too_wide = cloud;
  too_wide.width(cloud.width() + 1);
  send(too_wide);
  PointCloud2 no_z = cloud;
  no_z.fields()[2].name("height");
  send(no_z);
  PointCloud2 bad_type = cloud;
  bad_type.fields()[0].datatype(99);
  send(bad_type);
  send(PointCloud2());
  dds::ServerStatus now = status();
  EXPECT_EQ(now.counter("bad_clouds", "size_mismatch"), 1U);
  EXPECT_EQ(now.counter("bad_clouds", "no_xyz"), 1U);
  EXPECT_EQ(now.counter("bad_clouds", "bad_field"), 1U);
  EXPECT_EQ(now.counter("bad_clouds", "no_points"), 1U);
  EXPECT_THAT(now.reason, testing::HasSubstr("width 0"));

  send(room_scan(1));
  now = status();
  EXPECT_EQ(now.counter("scans_mapped"), 2U);
  EXPECT_THAT(now.reason, testing::Not(testing::HasSubstr("dropped")));
}

TEST(HostileEncoding, IsCountedAndNamedAndIsNoLoss) {
  const ServiceSetup setup("every");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  dds::Participant participant(setup.dds());
  const auto topic = dds::points_topic("points", DeliveryMode::every, 4);
  const auto type = dds::type_support<PointCloud2>();
  dds::SerializedSampleWriter clouds(participant, topic.dds_name, type.get_type_name(),
                                     topic.writer);
  ASSERT_TRUE(clouds.readers().wait_for_any(patience));
  const PointCloud2 cloud = wire::to_cloud(room_scan(0), {}, "lidar");
  for (const unsigned encapsulation : {0x01U, 0x07U}) {
    dds::SerializedSample bytes = dds::to_bytes(type, &cloud, 0);
    bytes[1] = static_cast<std::uint8_t>(encapsulation);
    eprosima::fastrtps::rtps::WriteParams params;
    ASSERT_TRUE(clouds.write(bytes, params));
  }
  ASSERT_TRUE(wait_for_scans(client, 2));
  const dds::ServerStatus now = client.status();
  EXPECT_EQ(now.counter("bad_clouds", "unreadable"), 1U);
  EXPECT_EQ(now.counter("scans_lost"), 0U);
  EXPECT_THAT(now.reason, testing::HasSubstr("XCDR2"));
}

TEST_F(HostileInput, ScansOutOfOrderOrRepeatedAreDropped) {
  for (const int index : {0, 1, 3, 2, 3, 4}) send(room_scan(index));
  const dds::ServerStatus now = status();
  EXPECT_EQ(now.counter("scans_mapped"), 4U);
  EXPECT_EQ(now.dropped("out_of_order"), 2U);
}

TEST_F(HostileInput, ScansWithoutAUsablePointAreDropped) {
  Scan nan = room_scan(0);
  for (auto& point : nan.points_lidar) point.setConstant(std::numeric_limits<float>::quiet_NaN());
  Scan infinite = room_scan(1);
  for (auto& point : infinite.points_lidar) {
    point.setConstant(std::numeric_limits<float>::infinity());
  }
  Scan zero = room_scan(2);
  for (auto& point : zero.points_lidar) point.setZero();
  for (const Scan& scan : {nan, infinite, zero}) send(scan);
  send(room_scan(3));
  const dds::ServerStatus now = status();
  EXPECT_EQ(now.dropped(), 3U);
  EXPECT_EQ(now.counter("scans_mapped"), 1U);
}

TEST_F(HostileInput, ScansWithAllPointsEqualOrHalfNanDoNoHarm) {
  send(room_scan(0));
  Scan equal = room_scan(1);
  for (auto& point : equal.points_lidar) point = {5.0F, 1.0F, 0.0F};
  send(equal);
  Scan half = room_scan(2);
  for (std::size_t i = 0; i < half.size(); i += 2) {
    half.points_lidar[i].setConstant(std::numeric_limits<float>::quiet_NaN());
  }
  for (auto& value : half.intensity) value = 0.0F;
  send(half);
  for (int index = 3; index < 6; ++index) send(room_scan(index));
  const dds::ServerStatus now = status();
  EXPECT_GE(now.counter("scans_mapped"), 5U);
  EXPECT_EQ(now.health, OdometryHealth::good);
}

TEST_F(HostileInput, FramesOfAnyLengthAndContentAreShownInALine) {
  const std::string frame = "fr\nont\xFF" + std::string(100'000, 'x');
  send(wire::to_cloud(room_scan(0), {}, frame));
  const dds::ServerStatus now = status();
  EXPECT_EQ(now.counter("scans_mapped"), 1U);
  EXPECT_EQ(now.scan_frame, "fr?ont?" + std::string(93, 'x') + "...");
}

}  // namespace
}  // namespace stillmap::test
