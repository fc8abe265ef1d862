#include <gtest/gtest.h>

#include <atomic>
#include <mutex>

#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

TEST(LosslessReplay, GivesEveryScanOnceAndInOrder) {
  const ServiceSetup setup("every");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  std::mutex mutex;
  std::vector<std::int64_t> stamps;
  const auto poses = client.subscribe_odometry([&](const OdometryUpdate& update) {
    const std::scoped_lock lock(mutex);
    stamps.push_back(update.pose.stamp_ns);
  });

  // As fast as it goes: many times faster than they can be mapped.
  constexpr int scans = 60;
  ScanPublisher publisher(setup.publisher(true));
  drive(publisher, 0, scans);
  EXPECT_TRUE(publisher.wait_for_all_acknowledged(patience));
  ASSERT_TRUE(wait_for_scans(client, scans));
  ASSERT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return stamps.size() >= scans;
  }));

  ASSERT_EQ(stamps.size(), static_cast<std::size_t>(scans));
  for (int i = 0; i < scans; ++i) {
    EXPECT_EQ(stamps[static_cast<std::size_t>(i)], room_pose(i).stamp_ns);
  }
  const dds::ServerStatus status = client.status();
  EXPECT_EQ(status.counter("scans_received"), static_cast<std::uint64_t>(scans));
  EXPECT_EQ(status.dropped(), 0U);
}

TEST(LatestDelivery, DropsTheOldestAndAccountsForEveryScan) {
  const ServiceSetup setup("latest");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  EXPECT_EQ(client.status().delivery, DeliveryMode::latest);

  constexpr int scans = 120;
  std::atomic<std::int64_t> newest_ns = 0;
  const Subscription poses = client.subscribe_odometry(
      [&](const OdometryUpdate& update) { newest_ns = update.pose.stamp_ns; });
  ScanPublisher publisher(setup.publisher(false));
  drive(publisher, 0, scans);
  // The newest is never dropped for older ones.
  ASSERT_TRUE(eventually([&] { return newest_ns == room_pose(scans - 1).stamp_ns; }));
  dds::ServerStatus status;
  ASSERT_TRUE(eventually([&] {
    status = client.status();
    return status.counter("scans_mapped") + status.dropped() == status.counter("scans_received");
  }));
  // What DDS itself replaced before the server saw it is not received; nothing else is missing.
  EXPECT_LE(status.counter("scans_received"), static_cast<std::uint64_t>(scans));
  EXPECT_GT(status.counter("scans_mapped"), 0U);
  EXPECT_EQ(status.dropped(), status.dropped("queue_full"));
}

}  // namespace
}  // namespace stillmap::test
