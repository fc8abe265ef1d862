#include "clients/doctor/checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/doctor/make_endpoint.hpp"

namespace stillmap::cli {
namespace {

using test::make_endpoint;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* cloud_type = "sensor_msgs::msg::dds_::PointCloud2_";

auto says(const std::string& what) { return Field(&dds::Diagnostic::what, HasSubstr(what)); }
auto shows(const std::string& text) { return Field(&dds::Diagnostic::evidence, HasSubstr(text)); }
auto advises(const std::string& text) { return Field(&dds::Diagnostic::hint, HasSubstr(text)); }

/// A healthy deployment, to be spoiled.
class ChecksTest : public testing::Test {
 protected:
  ChecksTest() {
    snapshot_.server_name = "stillmap";
    snapshot_.points_topic = "points";
    snapshot_.granted_buffer_bytes = 4U << 20U;
    snapshot_.host.max_receive_buffer_bytes = 4U << 20U;
    snapshot_.host.has_multicast_route = true;
    snapshot_.host.interfaces = {
        {.name = "eth0", .is_up = true, .is_loopback = false, .has_multicast = true}};
    snapshot_.frames = {"map", "lidar"};
    dds::RemoteParticipant lidar = participant("velodyne");
    lidar.endpoints = {make_endpoint("rt/points", cloud_type, true)};
    dds::RemoteParticipant server = participant("stillmap_server");
    server.endpoints = {make_endpoint("rq/stillmap/get_statusRequest", "request", false),
                        make_endpoint("rt/points", cloud_type, false)};
    snapshot_.participants = {lidar, server};
    DiscoveredServer seen;
    seen.name_space = "stillmap";
    seen.participants = {server};
    seen.status.emplace();
    seen.status->software_version = STILLMAP_VERSION;
    seen.status->points_topic = "points";
    seen.status->received_hz = 10.0;
    seen.status->scan_frame = "lidar";
    seen.status->counters = {{"scans_received", "", 100}, {"scans_mapped", "", 100}};
    seen.status->stamp_ns = seen.asked_ns = 1'000'000'000'000;
    snapshot_.servers = {seen};
  }

  static dds::RemoteParticipant participant(const std::string& name) {
    dds::RemoteParticipant made;
    made.guid = made.name = name;
    made.is_on_this_host = true;
    return made;
  }
  [[nodiscard]] dds::ServerStatus& status() { return *snapshot_.servers[0].status; }
  void no_scans() {
    status().received_hz = 0.0;
    status().counters = {{"scans_received", "", 0}};
    snapshot_.participants[0].endpoints.clear();
  }

  SystemSnapshot snapshot_;
};

TEST_F(ChecksTest, FindNothingInAHealthyDeployment) { EXPECT_THAT(diagnose(snapshot_), IsEmpty()); }

TEST_F(ChecksTest, AskForLargerBuffersWhereUdpIsNeeded) {
  snapshot_.host.max_receive_buffer_bytes = 212992;
  EXPECT_THAT(check_socket_buffers(snapshot_),
              ElementsAre(AllOf(Field(&dds::Diagnostic::severity, dds::Severity::advice),
                                shows("212992"), advises("sysctl net.core.rmem_max=4194304"))));
  snapshot_.participants[0].is_on_this_host = false;
  EXPECT_THAT(check_socket_buffers(snapshot_),
              ElementsAre(Field(&dds::Diagnostic::severity, dds::Severity::problem)));
}

TEST_F(ChecksTest, LookAtMulticast) {
  snapshot_.host.has_multicast_route = false;
  EXPECT_THAT(check_multicast(snapshot_), ElementsAre(advises("ip route add")));
  snapshot_.host.interfaces[0].has_multicast = false;
  EXPECT_THAT(check_multicast(snapshot_), ElementsAre(shows("eth0 carries no multicast")));
  snapshot_.host.interfaces[0].is_up = false;
  EXPECT_THAT(check_multicast(snapshot_), ElementsAre(shows("but the loopback")));
}

TEST_F(ChecksTest, LookAtSharedMemory) {
  snapshot_.host.user = 1000;
  snapshot_.host.segments = {
      {.name = "fastrtps_a", .bytes = 64U << 20U, .owner = 1000, .is_stale = true},
      {.name = "fastrtps_b", .bytes = 1, .owner = 0, .is_stale = false}};
  EXPECT_THAT(check_shared_memory(snapshot_),
              ElementsAre(AllOf(says("1 shared memory segments of dead"), shows("64 MiB"),
                                advises("--clean")),
                          AllOf(says("other users"), shows("belong to user 0"))));
  snapshot_.host.segments.clear();
  snapshot_.host.shared_memory_fault = "/dev/shm: Permission denied";
  EXPECT_THAT(check_shared_memory(snapshot_), ElementsAre(shows("Permission denied")));
  snapshot_.dds.shared_memory = false;
  EXPECT_THAT(check_shared_memory(snapshot_), IsEmpty());
}

TEST_F(ChecksTest, LookIntoOtherDomains) {
  snapshot_.other_domains = {
      {.id = 7, .senders = {"10.0.0.5"}, .participants = snapshot_.participants}};
  snapshot_.participants.clear();
  snapshot_.servers.clear();
  EXPECT_THAT(
      diagnose(snapshot_),
      ElementsAre(AllOf(says("nobody else is in domain 0"),
                        shows("domain 7 has the server stillmap_server"), advises("--domain"))));
  snapshot_.other_domains.clear();
  EXPECT_THAT(check_domain(snapshot_), ElementsAre(advises("start stillmap-server")));
}

TEST_F(ChecksTest, LookForTheServer) {
  snapshot_.server_name = "stilmap";
  EXPECT_THAT(check_servers(snapshot_), ElementsAre(advises("did you mean --server stillmap?")));
  snapshot_.servers.clear();
  EXPECT_THAT(check_servers(snapshot_), ElementsAre(advises("start stillmap-server")));
}

TEST_F(ChecksTest, CountServersOfOneName) {
  snapshot_.servers[0].participants.push_back(participant("second"));
  EXPECT_THAT(check_servers(snapshot_), ElementsAre(says("2 servers are called 'stillmap'")));
}

TEST_F(ChecksTest, CompareVersionsAndWantAnAnswer) {
  status().software_version = "0.0.9";
  EXPECT_THAT(check_servers(snapshot_), ElementsAre(shows("server 0.0.9")));
  snapshot_.servers[0].status.reset();
  snapshot_.servers[0].fault = "no answer within 5000 ms";
  EXPECT_THAT(check_servers(snapshot_), ElementsAre(shows("no answer within")));
}

TEST_F(ChecksTest, SayWhyThereAreNoScans) {
  no_scans();
  EXPECT_THAT(check_scans(snapshot_),
              ElementsAre(AllOf(says("nobody publishes rt/points"), advises("lidar's driver"))));
  snapshot_.other_domains = {{.id = 3, .senders = {}, .participants = {participant("lidar")}}};
  snapshot_.other_domains[0].participants[0].endpoints = {
      make_endpoint("rt/points", cloud_type, true)};
  EXPECT_THAT(check_scans(snapshot_), ElementsAre(shows("in domain 3")));
  snapshot_.participants[0].endpoints = {make_endpoint("rt/velodyne_points", cloud_type, true)};
  EXPECT_THAT(check_scans(snapshot_),
              ElementsAre(AllOf(shows("velodyne_points"), advises("did you mean"))));
}

TEST_F(ChecksTest, TellRefusedCloudsByReason) {
  status().counters = {{"scans_received", "", 10}, {"bad_clouds", "no_xyz", 10}};
  status().reason = "the last scan was dropped: bad cloud: no field x";
  EXPECT_THAT(check_scans(snapshot_),
              ElementsAre(AllOf(says("clouds are refused: no_xyz"), shows("10 of 10 scans"),
                                shows("no field x"),
                                Field(&dds::Diagnostic::severity, dds::Severity::problem))));
}

TEST_F(ChecksTest, TellWhatCannotBeRead) {
  status().counters = {{"scans_received", "", 10},
                       {"bad_clouds", "unreadable", 10},
                       {"tf_static_unreadable", "", 3}};
  status().reason = "the last scan was dropped: bad cloud: it has 99 bytes of XCDR2";
  EXPECT_THAT(check_scans(snapshot_),
              ElementsAre(AllOf(says("unreadable"), shows("XCDR2"), advises("classic CDR")),
                          AllOf(says("tf_static"), shows("3 messages"), advises("classic CDR"))));
}

TEST_F(ChecksTest, AskAboutTimeZonesWhereClocksDifferByHours) {
  status().counters = {{"scans_received", "", 10}};
  for (const double delay_s : {3590.0, 3600.2, 3660.0}) {
    status().scan_delay_s = delay_s;
    EXPECT_THAT(check_clocks(snapshot_), ElementsAre(AllOf(says(" h "), says("time zone"))));
  }
  status().scan_delay_s = 8 * 3600.0 + 65.0;
  EXPECT_THAT(check_clocks(snapshot_), ElementsAre(says("8 h 1 min")));
  for (const double delay_s : {5400.0, 15 * 3600.0, 2.0e7}) {
    status().scan_delay_s = delay_s;
    EXPECT_THAT(check_clocks(snapshot_), IsEmpty());
  }
}

TEST_F(ChecksTest, LookForTheFrame) {
  status().scan_frame = "velodyne";
  EXPECT_THAT(check_frames(snapshot_), ElementsAre(AllOf(says("'velodyne'"), shows("lidar, map"))));
  status().scan_frame = "";
  EXPECT_THAT(check_frames(snapshot_), ElementsAre(says("name no frame")));
}

TEST_F(ChecksTest, CompareClocks) {
  status().stamp_ns += 3'000'000'000;
  EXPECT_THAT(check_clocks(snapshot_), ElementsAre(shows("3.00 s ahead")));
  snapshot_.servers[0].round_trip_ns = 8'000'000'000;
  EXPECT_THAT(check_clocks(snapshot_), IsEmpty());
  status().scan_delay_s = -0.5;
  EXPECT_THAT(check_clocks(snapshot_), ElementsAre(says("from the future")));
  status().scan_delay_s = 4.0;
  EXPECT_THAT(check_clocks(snapshot_), ElementsAre(says("come late")));
  status().scan_delay_s = 4e8;
  EXPECT_THAT(check_clocks(snapshot_), IsEmpty());
}

TEST_F(ChecksTest, PassOnWhatTheServerFoundAndSayThingsOnce) {
  const dds::Diagnostic found{.what = "odd", .evidence = "seen", .hint = "do"};
  status().diagnostics = {found, found};
  EXPECT_THAT(diagnose(snapshot_), ElementsAre(says("odd")));
}

}  // namespace
}  // namespace stillmap::cli
