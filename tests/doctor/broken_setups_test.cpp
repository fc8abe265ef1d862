#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "clients/library/scan_publisher.hpp"
#include "idl/dds/ros_graph.hpp"
#include "idl/dds/writer.hpp"
#include "nav_msgs.h"
#include "rmw_dds_common.h"
#include "sensor_msgs.h"
#include "tests/clients/process.hpp"
#include "tests/eventually.hpp"
#include "tests/scratch_folder.hpp"
#include "tests/server/room_scans.hpp"

namespace stillmap::test {
namespace {

using nlohmann::json;
using sensor_msgs::msg::PointCloud2;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ResultOf;

auto field(const std::string& name, const std::string& part) {
  return ResultOf([name](const json& diagnostic) { return diagnostic.at(name).get<std::string>(); },
                  HasSubstr(part));
}

/// A real server, and something wrong with what is round it.
class BrokenSetup : public testing::Test {
 protected:
  [[nodiscard]] dds::DdsOptions dds(int domain) const {
    dds::DdsOptions options;
    options.domain_id = static_cast<std::uint32_t>(domain);
    options.interfaces = {"127.0.0.1"};
    options.node_name = "lidar_driver";
    return options;
  }

  void start_server(const std::string& more = "", const std::string& before = "") {
    (void)folder_.file("server.yaml",
                       "sensor: vlp_16\nlabels: {source: none}\n"
                       "dds: {interfaces: [127.0.0.1]}\n");
    server_.emplace(before + stillmap_server_program() + " --config " +
                        (folder_ / "server.yaml").string() + " --domain " +
                        std::to_string(domain_) + " " + more,
                    folder_ / "server.log");
    const auto log = [this] { return content_of(folder_ / "server.log"); };
    ASSERT_TRUE(eventually([&] { return log().find("ready") != std::string::npos; })) << log();
  }

  /// Problems that doctor finds, and its exit code in `exit_code_`.
  [[nodiscard]] std::vector<json> problems(const std::string& more = "") {
    const ProcessResult result = run_stillmap(
        "doctor --json --interface 127.0.0.1 --domain " + std::to_string(domain_) + " " + more,
        folder_.path());
    exit_code_ = result.exit_code;
    std::vector<json> found;
    if (!json::accept(result.out)) {
      ADD_FAILURE() << result.out << result.err;
      return found;
    }
    const json report = json::parse(result.out);
    for (const json& diagnostic : report.at("diagnostics")) {
      if (diagnostic.at("severity") == "problem") found.push_back(diagnostic);
    }
    return found;
  }

  ScratchFolder folder_;
  int domain_ = free_domain();
  std::optional<BackgroundProcess> server_;
  int exit_code_ = -1;
};

TEST_F(BrokenSetup, IsTheLastThingThatAHealthyOneIs) {
  start_server();
  ScanPublisher publisher({.dds = dds(domain_), .points_topic = "points"});
  const std::jthread lidar([&](const std::stop_token& stop) {
    for (int i = 0; !stop.stop_requested(); ++i) {
      (void)publisher.publish(room_scan(i));
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  });
  const auto found = problems();
  EXPECT_THAT(found, IsEmpty());
  EXPECT_EQ(exit_code_, 0);
}

TEST_F(BrokenSetup, IsNoneThatADiscoveryServerTellsOf) {
  dds::DdsOptions options = dds(domain_);
  options.node_name = "";
  options.shared_memory = false;
  options.discovery_port = static_cast<std::uint16_t>(21'000 + domain_);
  const dds::Participant discovery_server(options);
  const std::string by =
      "--dds-profile no_multicast --discovery-server 127.0.0.1:" + std::to_string(21'000 + domain_);
  start_server(by);
  dds::DdsOptions told = dds(domain_);
  told.multicast = false;
  told.discovery_server = {.host = "127.0.0.1", .port = options.discovery_port};
  ScanPublisher publisher({.dds = told, .points_topic = "points"});
  const std::jthread lidar([&](const std::stop_token& stop) {
    for (int i = 0; !stop.stop_requested(); ++i) {
      (void)publisher.publish(room_scan(i));
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  });
  EXPECT_THAT(problems(by), IsEmpty());
  EXPECT_EQ(exit_code_, 0);
}

TEST_F(BrokenSetup, NamesTheNodesOfAParticipantWithoutAName) {
  dds::DdsOptions options = dds(domain_);
  options.node_name = "";
  // As rmw_fastrtps names those of all its processes.
  options.participant_name = "/";
  dds::Participant participant(options);
  using rmw_dds_common::msg::ParticipantEntitiesInfo;
  dds::Writer<ParticipantEntitiesInfo> writer(participant, dds::ros_discovery_topic,
                                              {.transient_local = true, .depth = 1});
  ParticipantEntitiesInfo info;
  info.node_entities_info_seq().resize(1);
  info.node_entities_info_seq()[0].node_namespace("/robot");
  info.node_entities_info_seq()[0].node_name("rviz2");
  ASSERT_TRUE(writer.write(info));
  const std::string doctor = "doctor --interface 127.0.0.1 --domain " + std::to_string(domain_);
  EXPECT_THAT(run_stillmap(doctor, folder_.path()).out, HasSubstr("\n/robot/rviz2 "));
  const std::string out = run_stillmap(doctor + " --json", folder_.path()).out;
  ASSERT_TRUE(json::accept(out)) << out;
  EXPECT_THAT(json::parse(out).at("participants"),
              Contains(ResultOf([](const json& one) { return one.at("nodes"); },
                                json::array({"/robot/rviz2"}))));
}

TEST_F(BrokenSetup, WithoutAPublisher) {
  start_server();
  const auto found = problems();
  // Elsewhere on this machine somebody may publish scans: then that is the way out.
  EXPECT_THAT(
      found,
      Contains(AllOf(field("what", "nobody publishes rt/points"),
                     AnyOf(field("hint", "stillmap replay"), field("hint", "into one domain")))));
  EXPECT_EQ(exit_code_, 1);
}

TEST_F(BrokenSetup, WithAPublisherOnAnotherTopic) {
  start_server();
  dds::Participant participant(dds(domain_));
  const dds::Writer<PointCloud2> writer(participant, "rt/velodyne_points", {});
  EXPECT_THAT(problems(),
              Contains(AllOf(field("evidence", "velodyne_points"), field("hint", "did you mean"))));
}

TEST_F(BrokenSetup, WithABestEffortPublisherForAReliableServer) {
  start_server("--delivery every");
  dds::Participant participant(dds(domain_));
  const dds::Writer<PointCloud2> writer(participant, "rt/points", {.reliable = false});
  EXPECT_THAT(
      problems(),
      Contains(AllOf(field("what", "what /lidar_driver writes does not reach /stillmap_server"),
                     field("evidence", "reliability: the writer offers best effort"),
                     field("hint", "input.delivery: latest"))));
  const ProcessResult status = run_stillmap(
      "status --json --interface 127.0.0.1 --domain " + std::to_string(domain_), folder_.path());
  EXPECT_THAT(status.out, HasSubstr("does not reach /stillmap_server"));
}

TEST_F(BrokenSetup, WithAPublisherOfAnotherType) {
  start_server();
  dds::Participant participant(dds(domain_));
  const dds::Writer<nav_msgs::msg::Odometry> writer(participant, "rt/points", {});
  EXPECT_THAT(problems(), Contains(field("evidence",
                                         "type: the writer has nav_msgs::msg::dds_::"
                                         "Odometry_")));
}

TEST_F(BrokenSetup, WithAPeerWhoseNameIsNotKnown) {
  start_server("--peer no-such-host..invalid");
  EXPECT_THAT(problems(), Contains(AllOf(field("what", "'no-such-host..invalid' is not looked for"),
                                         field("hint", "dds.peers"))));
}

TEST_F(BrokenSetup, WithTheServerInAnotherDomain) {
  start_server();
  const int servers_domain = domain_;
  domain_ = free_domain();
  // The doctor of another test may be there for a moment, looking for servers as this one does.
  const std::string here = " in domain " + std::to_string(domain_);
  const auto names_the_servers_domain = Contains(AllOf(
      AnyOf(field("what", "nobody else is" + here), field("what", "no server 'stillmap'" + here)),
      field("evidence", "domain " + std::to_string(servers_domain))));
  // It looks into twelve domains for a moment, and other tests have many.
  std::vector<json> found;
  for (int attempt = 0; attempt < 3; ++attempt) {
    found = problems();
    if (testing::Matches(names_the_servers_domain)(found)) break;
  }
  EXPECT_THAT(found, names_the_servers_domain);
}

TEST_F(BrokenSetup, WithSecurityOnOneSideOnly) {
  ASSERT_EQ(run_stillmap("security init " + (folder_ / "keys").string(), folder_.path()).exit_code,
            0);
  start_server("--security " + (folder_ / "keys/server").string());
  EXPECT_THAT(
      problems(),
      Contains(AllOf(field("what", "stillmap_server is secured and /stillmap_doctor is not"),
                     field("hint", "--security"))));
  const auto found = problems("--security " + (folder_ / "keys/planner").string());
  EXPECT_THAT(found, Contains(field("what", "nobody publishes rt/points")));
  EXPECT_THAT(found, testing::Not(Contains(field("what", "secured"))));
}

TEST_F(BrokenSetup, WithSharedMemoryOfItsOwn) {
  if (::geteuid() != 0 || std::system("unshare -m true 2>/dev/null") != 0) {
    GTEST_SKIP() << "a mount namespace takes root (unshare -m)";
  }
  const auto script = folder_.file("own_shm.sh", "mount -t tmpfs none /dev/shm && exec \"$@\"\n");
  start_server("", "unshare -m sh " + script.string() + " ");
  EXPECT_THAT(problems(), Contains(AllOf(field("what", "nothing of stillmap_server arrives"),
                                         field("hint", "--udp-only"))));
}

TEST_F(BrokenSetup, WithTwoServersOfOneName) {
  start_server();
  const BackgroundProcess second(stillmap_server_program() + " --config " +
                                     (folder_ / "server.yaml").string() + " --domain " +
                                     std::to_string(domain_),
                                 folder_ / "second.log");
  EXPECT_THAT(problems("--listen 6"), Contains(field("what", "2 servers are called 'stillmap'")));
}

TEST_F(BrokenSetup, WithSmallBuffersAndStaleSharedMemory) {
  (void)folder_.file("host/proc/sys/net/core/rmem_max", "212992\n");
  (void)folder_.file("host/dev/shm/fastrtps_00000000deadbeef", "left behind");
  start_server();
  const std::string root = " --host-root " + (folder_ / "host").string();
  EXPECT_THAT(problems("--udp-only" + root),
              Contains(AllOf(field("what", "UDP buffers are too small"),
                             field("hint", "sysctl net.core.rmem_max="))));
  const ProcessResult cleaned = run_stillmap(
      "doctor --clean --interface 127.0.0.1 --domain " + std::to_string(domain_) + root,
      folder_.path());
  EXPECT_THAT(cleaned.err, HasSubstr("removed 1 shared memory segments"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "host/dev/shm/fastrtps_00000000deadbeef"));
}

}  // namespace
}  // namespace stillmap::test
