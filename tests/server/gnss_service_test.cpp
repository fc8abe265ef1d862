#include <gtest/gtest.h>

#include <limits>

#include "core/geodesy/east_north_up.hpp"
#include "core/map/storage/map_file.hpp"
#include "idl/conversions/gnss.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/dds/reader.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

const EastNorthUp earth(49.0, 8.4, 115.0);
const Eigen::Isometry3d T_enu_room =
    Eigen::Translation3d(40.0, -30.0, 2.0) * Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ());
const Eigen::Vector3d antenna_lidar(0.5, -0.2, 0.3);

GnssFix fix_at(int index) {
  const StampedPose pose = room_pose(index);
  GnssFix fix = earth.fix_at(T_enu_room * pose.T_map_lidar * antenna_lidar);
  fix.stamp_ns = pose.stamp_ns;
  fix.covariance_enu = 0.0004 * Eigen::Matrix3d::Identity();
  return fix;
}

/// What no receiver should send: a latitude that is no number, and no fix at all.
std::vector<sensor_msgs::msg::NavSatFix> useless_fixes(const GnssFix& fix) {
  auto not_a_number = wire::to_nav_sat_fix(fix, "antenna");
  not_a_number.latitude(std::numeric_limits<double>::quiet_NaN());
  auto none = wire::to_nav_sat_fix(fix, "antenna");
  none.status().status(0xFF);
  return {not_a_number, none};
}

void expect_near(const Datum& datum, const Datum& expected) {
  EXPECT_NEAR(datum.latitude_deg, expected.latitude_deg, 3e-6);
  EXPECT_NEAR(datum.longitude_deg, expected.longitude_deg, 4e-6);
  EXPECT_NEAR(datum.altitude_m, expected.altitude_m, 0.3);
  EXPECT_NEAR(datum.x_axis_azimuth_deg, expected.x_axis_azimuth_deg, 0.5);
}

TEST(GnssService, TheMapIsPutOnTheEarthAndItsFileSaysWhere) {
  const ServiceSetup setup("every");
  setup.add("topics: {gnss: gps/fix}\ngnss: {antenna_m: [0.5, -0.2, 0.3]}\n");
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisherOptions options = setup.publisher(true);
  options.gnss_topic = "gps/fix";
  ScanPublisher publisher(options);
  ASSERT_TRUE(publisher.wait_for_subscriber(patience));
  dds::Participant participant(setup.dds());
  const auto spec = dds::gnss_topic("gps/fix", DeliveryMode::every);
  dds::Writer<sensor_msgs::msg::NavSatFix> receiver(participant, spec.dds_name, spec.writer);
  ASSERT_TRUE(receiver.readers().wait_for_any(patience));
  const auto tf_static = dds::Topics::in("stillmap").tf_static;
  dds::Reader<tf2_msgs::msg::TFMessage> transforms(participant, tf_static.dds_name,
                                                   tf_static.reader);

  // Up and down the hall, with every second scan: some 60 m, of which positions every 5 m count.
  constexpr int end = 640;
  constexpr int scans = end / 2;
  for (int index = 0; index < end; index += 2) {
    const GnssFix fix = fix_at(index);
    EXPECT_EQ(publisher.publish({&fix, 1}, patience), 1U);
    if (index == 10) {
      for (auto& useless : useless_fixes(fix)) EXPECT_TRUE(receiver.write(useless));
    }
    ASSERT_TRUE(publisher.publish(room_scan(index), {}, patience));
  }
  ASSERT_TRUE(wait_for_scans(client, scans));
  EXPECT_TRUE(eventually([&] { return client.status().counter("gnss_fixes") > 250; }));
  EXPECT_EQ(client.status().counter("gnss_fixes_refused"), 1U);
  EXPECT_EQ(client.status().counter("gnss_without_fix"), 1U);

  tf2_msgs::msg::TFMessage message;
  const std::stop_source never;
  ASSERT_TRUE(transforms.take(message, never.get_token(), patience));
  ASSERT_EQ(message.transforms().size(), 1U);
  EXPECT_EQ(message.transforms()[0].header().frame_id(), "earth");
  EXPECT_EQ(message.transforms()[0].child_frame_id(), "map");
  const Eigen::Isometry3d T_enu_map = T_enu_room * room_pose(0).T_map_lidar;
  const auto& t = message.transforms()[0].transform().translation();
  EXPECT_LT((Eigen::Vector3d(t.x(), t.y(), t.z()) - earth.T_earth(T_enu_map).translation()).norm(),
            0.3);

  client.save_map();
  const SavedMap stored = open_map_file(setup.map_file())->load();
  ASSERT_TRUE(stored.metadata.contains("datum"));
  expect_near(datum_from_text(stored.metadata.at("datum")), earth.datum_of(T_enu_map));

  // Another map is somewhere else.
  client.reset();
  drive(publisher, end, end + 3);
  ASSERT_TRUE(wait_for_scans(client, scans + 3));
  client.save_map();
  EXPECT_FALSE(open_map_file(setup.map_file())->load().metadata.contains("datum"));
}

}  // namespace
}  // namespace stillmap::test
