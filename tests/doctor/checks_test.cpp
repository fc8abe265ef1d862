#include "clients/doctor/checks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/doctor/make_endpoint.hpp"

namespace stillmap {
namespace {

using test::end;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char* cloud_type = "sensor_msgs::msg::dds_::PointCloud2_";

auto says(const std::string& what) { return Field(&Finding::what, HasSubstr(what)); }
auto shows(const std::string& text) { return Field(&Finding::evidence, HasSubstr(text)); }
auto advises(const std::string& text) { return Field(&Finding::way_out, HasSubstr(text)); }

/// A healthy deployment, to be spoiled.
class ChecksTest : public testing::Test {
 protected:
  ChecksTest() {
    evidence_.server_name = "stillmap";
    evidence_.points_topic = "points";
    evidence_.granted_buffer_bytes = 4U << 20U;
    evidence_.host.largest_receive_buffer = 4U << 20U;
    evidence_.host.has_multicast_route = true;
    evidence_.host.interfaces = {
        {.name = "eth0", .is_up = true, .is_loopback = false, .has_multicast = true}};
    evidence_.frames = {"map", "lidar"};
    Peer lidar = peer("velodyne");
    lidar.endpoints = {end("rt/points", cloud_type, true)};
    Peer server = peer("stillmap_server");
    server.endpoints = {end("rq/stillmap/get_statusRequest", "request", false),
                        end("rt/points", cloud_type, false)};
    evidence_.peers = {lidar, server};
    ServerSeen seen;
    seen.name_space = "stillmap";
    seen.peers = {server};
    seen.status.emplace();
    seen.status->software_version = STILLMAP_VERSION;
    seen.status->points_topic = "points";
    seen.status->received_hz = 10.0;
    seen.status->scan_frame = "lidar";
    seen.status->counters = {{"scans_received", 100}, {"scans_mapped", 100}};
    seen.status->stamp_ns = seen.asked_ns = 1'000'000'000'000;
    evidence_.servers = {seen};
  }

  static Peer peer(const std::string& name) {
    Peer made;
    made.guid = made.name = name;
    made.is_on_this_host = true;
    return made;
  }
  [[nodiscard]] ServerStatus& status() { return *evidence_.servers[0].status; }
  void no_scans() {
    status().received_hz = 0.0;
    status().counters = {{"scans_received", 0}};
    evidence_.peers[0].endpoints.clear();
  }

  Evidence evidence_;
};

TEST_F(ChecksTest, FindNothingInAHealthyDeployment) { EXPECT_THAT(diagnose(evidence_), IsEmpty()); }

TEST_F(ChecksTest, AskForLargerBuffersWhereUdpIsNeeded) {
  evidence_.host.largest_receive_buffer = 212992;
  EXPECT_THAT(check_socket_buffers(evidence_),
              ElementsAre(AllOf(Field(&Finding::severity, Severity::advice), shows("212992"),
                                advises("sysctl net.core.rmem_max=4194304"))));
  evidence_.peers[0].is_on_this_host = false;
  EXPECT_THAT(check_socket_buffers(evidence_),
              ElementsAre(Field(&Finding::severity, Severity::problem)));
}

TEST_F(ChecksTest, LookAtMulticast) {
  evidence_.host.has_multicast_route = false;
  EXPECT_THAT(check_multicast(evidence_), ElementsAre(advises("ip route add")));
  evidence_.host.interfaces[0].has_multicast = false;
  EXPECT_THAT(check_multicast(evidence_), ElementsAre(shows("eth0 carries no multicast")));
  evidence_.host.interfaces[0].is_up = false;
  EXPECT_THAT(check_multicast(evidence_), ElementsAre(shows("but the loopback")));
}

TEST_F(ChecksTest, LookAtSharedMemory) {
  evidence_.host.user = 1000;
  evidence_.host.segments = {
      {.name = "fastrtps_a", .bytes = 64U << 20U, .owner = 1000, .is_stale = true},
      {.name = "fastrtps_b", .bytes = 1, .owner = 0, .is_stale = false}};
  EXPECT_THAT(check_shared_memory(evidence_),
              ElementsAre(AllOf(says("1 shared memory segments of dead"), shows("64 MiB"),
                                advises("--clean")),
                          AllOf(says("other users"), shows("belong to user 0"))));
  evidence_.host.segments.clear();
  evidence_.host.shared_memory_fault = "/dev/shm: Permission denied";
  EXPECT_THAT(check_shared_memory(evidence_), ElementsAre(shows("Permission denied")));
  evidence_.dds.shared_memory = false;
  EXPECT_THAT(check_shared_memory(evidence_), IsEmpty());
}

TEST_F(ChecksTest, LookIntoOtherDomains) {
  evidence_.other_domains = {{.id = 7, .senders = {"10.0.0.5"}, .peers = evidence_.peers}};
  evidence_.peers.clear();
  evidence_.servers.clear();
  EXPECT_THAT(
      diagnose(evidence_),
      ElementsAre(AllOf(says("nobody else is in domain 0"),
                        shows("domain 7 has the server stillmap_server"), advises("--domain"))));
  evidence_.other_domains.clear();
  EXPECT_THAT(check_domain(evidence_), ElementsAre(advises("start stillmap-server")));
}

TEST_F(ChecksTest, LookForTheServer) {
  evidence_.server_name = "stilmap";
  EXPECT_THAT(check_servers(evidence_), ElementsAre(advises("did you mean --server stillmap?")));
  evidence_.servers.clear();
  EXPECT_THAT(check_servers(evidence_), ElementsAre(advises("start stillmap-server")));
}

TEST_F(ChecksTest, CountServersOfOneName) {
  evidence_.servers[0].peers.push_back(peer("second"));
  EXPECT_THAT(check_servers(evidence_), ElementsAre(says("2 servers are called 'stillmap'")));
}

TEST_F(ChecksTest, CompareVersionsAndWantAnAnswer) {
  status().software_version = "0.0.9";
  EXPECT_THAT(check_servers(evidence_), ElementsAre(shows("server 0.0.9")));
  evidence_.servers[0].status.reset();
  evidence_.servers[0].fault = "no answer within 5000 ms";
  EXPECT_THAT(check_servers(evidence_), ElementsAre(shows("no answer within")));
}

TEST_F(ChecksTest, SayWhyThereAreNoScans) {
  no_scans();
  EXPECT_THAT(check_scans(evidence_),
              ElementsAre(AllOf(says("nobody publishes rt/points"), advises("lidar's driver"))));
  evidence_.other_domains = {{.id = 3, .senders = {}, .peers = {peer("lidar")}}};
  evidence_.other_domains[0].peers[0].endpoints = {end("rt/points", cloud_type, true)};
  EXPECT_THAT(check_scans(evidence_), ElementsAre(shows("in domain 3")));
  evidence_.peers[0].endpoints = {end("rt/velodyne_points", cloud_type, true)};
  EXPECT_THAT(check_scans(evidence_),
              ElementsAre(AllOf(shows("velodyne_points"), advises("did you mean"))));
}

TEST_F(ChecksTest, TellRefusedCloudsByReason) {
  status().counters = {{"scans_received", 10}, {"dropped_bad_cloud_no_xyz", 10}};
  status().reason = "the last scan was dropped: bad cloud: no field x";
  EXPECT_THAT(
      check_scans(evidence_),
      ElementsAre(AllOf(says("clouds are refused: no_xyz"), shows("10 of 10 scans"),
                        shows("no field x"), Field(&Finding::severity, Severity::problem))));
}

TEST_F(ChecksTest, LookForTheFrame) {
  status().scan_frame = "velodyne";
  EXPECT_THAT(check_frames(evidence_), ElementsAre(AllOf(says("'velodyne'"), shows("lidar, map"))));
  status().scan_frame = "";
  EXPECT_THAT(check_frames(evidence_), ElementsAre(says("name no frame")));
}

TEST_F(ChecksTest, CompareClocks) {
  status().stamp_ns += 3'000'000'000;
  EXPECT_THAT(check_clocks(evidence_), ElementsAre(shows("3.00 s ahead")));
  evidence_.servers[0].round_trip_ns = 8'000'000'000;
  EXPECT_THAT(check_clocks(evidence_), IsEmpty());
  status().scan_delay_s = -0.5;
  EXPECT_THAT(check_clocks(evidence_), ElementsAre(says("from the future")));
  status().scan_delay_s = 4.0;
  EXPECT_THAT(check_clocks(evidence_), ElementsAre(says("come late")));
  status().scan_delay_s = 4e8;
  EXPECT_THAT(check_clocks(evidence_), IsEmpty());
}

TEST_F(ChecksTest, PassOnWhatTheServerFoundAndSayThingsOnce) {
  const Finding found{.what = "odd", .evidence = "seen", .way_out = "do"};
  status().findings = {found, found};
  EXPECT_THAT(diagnose(evidence_), ElementsAre(says("odd")));
}

}  // namespace
}  // namespace stillmap
