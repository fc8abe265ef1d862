#include <fastdds/rtps/transport/TCPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "idl/dds/discovery.hpp"
#include "idl/dds/qos.hpp"
#include "idl/dds/reader.hpp"
#include "idl/dds/transports.hpp"
#include "idl/dds/writer.hpp"
#include "sensor_msgs.h"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using namespace eprosima::fastdds::rtps;
using eprosima::fastdds::dds::DomainParticipantQos;
using sensor_msgs::msg::PointCloud2;

/// Of this process, so that tests beside each other do not meet; below those that Linux gives out.
std::uint16_t test_port() { return static_cast<std::uint16_t>(20000 + ::getpid() % 10000); }

bool finds(Participant& a, Participant& b, std::chrono::milliseconds timeout = discovery_timeout) {
  Writer<PointCloud2> writer(a, "rt/points", {});
  Reader<PointCloud2> reader(b, "rt/points", {});
  return writer.readers().wait_for_any(timeout) && reader.events().wait_for_writer(timeout);
}

void expect_large_clouds_arrive(Participant& a, Participant& b) {
  Writer<PointCloud2> writer(a, "rt/points", {});
  Reader<PointCloud2> reader(b, "rt/points", {});
  ASSERT_TRUE(writer.readers().wait_for_any(discovery_timeout));
  for (std::uint32_t i = 1; i <= 3; ++i) {
    ASSERT_TRUE(writer.write(cloud_of(2'000'000, i)));
    PointCloud2 got;
    ASSERT_TRUE(reader.take(got, {}, discovery_timeout));
    EXPECT_EQ(got.width(), i);
    EXPECT_EQ(got.data().size(), 2'000'000U);
  }
}

bool exchange(Participant& from, Participant& to) {
  Writer<PointCloud2> writer(from, "rt/points", {});
  Reader<PointCloud2> reader(to, "rt/points", {});
  PointCloud2 got;
  constexpr auto timeout = 5s * test::slowdown;
  return writer.readers().wait_for_any(timeout) && writer.write(cloud_of(1, 1)) &&
         reader.take(got, {}, timeout);
}

/// As clients do it: where Fast DDS loses an answer over TCP, another try finds the server.
std::unique_ptr<Participant> connected(Participant& server, const DdsOptions& options) {
  for (int attempt = 0; attempt < 5; ++attempt) {
    auto client = std::make_unique<Participant>(options);
    if (exchange(server, *client) && exchange(*client, server)) return client;
  }
  return nullptr;
}

DdsOptions tcp_server() {
  DdsOptions options = loopback(false);
  options.transport = NetworkTransport::tcp;
  options.listening_port = test_port();
  return options;
}

DdsOptions tcp_client() {
  DdsOptions options = tcp_server();
  options.peers = {{"127.0.0.1", options.listening_port}};
  options.listening_port = 0;
  return options;
}

DdsOptions without_multicast() {
  DdsOptions options = loopback(false);
  options.multicast = false;
  return options;
}

DdsOptions small_memory() {
  DdsOptions options = loopback(true);
  options.shared_memory_mib = 1;
  return options;
}

// Fast DDS numbers the participants of a process, and ends the process over a number used twice.
TEST(ManyParticipants, OfOneProcessGetAlong) {
  DdsOptions node = small_memory();
  node.node_name = "node";
  const Participant first(node);
  const Participant stays(small_memory());
  for (int i = 0; i < 130; ++i) {
    const Participant passes(small_memory());
    ASSERT_NE(passes.self().guid, stays.self().guid);
  }
}

/// What processes leave of the ports of a domain in shared memory.
class LeftPorts {
 public:
  enum class By { ended, killed };

  /// Of all ports but these, in a domain where nobody left any yet.
  explicit LeftPorts(By by, const std::vector<std::uint32_t>& others = {}) {
    while (!std::ranges::none_of(files(""), [](const auto& file) { return exists(file); }))
      lease_.emplace(test::DomainLease::take());
    for (const std::string& suffix :
         by == By::ended ? std::vector<std::string>{""} : std::vector<std::string>{"", "_el"}) {
      const auto all = files(suffix);
      for (std::uint32_t port = 0; port < ports; ++port) {
        if (std::ranges::find(others, port) != others.end()) continue;
        std::ofstream(all[port]) << "left behind";
      }
    }
  }
  ~LeftPorts() {
    std::error_code ignored;
    for (const char* suffix : {"", "_el"})
      for (const auto& file : files(suffix)) std::filesystem::remove(file, ignored);
  }
  LeftPorts(const LeftPorts&) = delete;
  LeftPorts& operator=(const LeftPorts&) = delete;

  [[nodiscard]] std::uint32_t domain_id() const {
    return static_cast<std::uint32_t>(lease_->domain());
  }
  [[nodiscard]] bool is_there(std::uint32_t port, const std::string& suffix = "") const {
    return exists(files(suffix)[port]);
  }

 private:
  static constexpr std::uint32_t ports = 250;

  [[nodiscard]] std::vector<std::filesystem::path> files(const std::string& suffix) const {
    std::vector<std::filesystem::path> files;
    for (std::uint32_t port = 0; port < ports; ++port) {
      files.push_back("/dev/shm/fastrtps_port" + std::to_string(7400 + ports * domain_id() + port) +
                      suffix);
    }
    return files;
  }

  std::optional<test::DomainLease> lease_ = test::DomainLease::take();
};

DdsOptions small_memory(const LeftPorts& left) {
  DdsOptions options = small_memory();
  options.domain_id = left.domain_id();
  return options;
}

TEST(ManyParticipants, GetAlongWhereProcessesLeftAllPorts) {
  const LeftPorts left(LeftPorts::By::ended);
  const Participant stays(small_memory(left));
  for (int i = 0; i < 130; ++i) {
    const Participant passes(small_memory(left));
    EXPECT_NE(passes.self().guid, stays.self().guid);
  }
}

// Each thread looks at all ports.
TEST(ManyParticipants, ThatThreadsMakeAtOnceHaveDifferentPorts) {
  const LeftPorts left(LeftPorts::By::ended);
  constexpr int count = 12;
  std::mutex mutex;
  std::vector<std::unique_ptr<Participant>> made;
  std::vector<std::jthread> threads;
  for (int i = 0; i < count; ++i) {
    threads.emplace_back([&] {
      try {
        auto participant = std::make_unique<Participant>(small_memory(left));
        const std::scoped_lock lock(mutex);
        made.push_back(std::move(participant));
      } catch (const DdsError& error) {
        ADD_FAILURE() << error.what();
      }
    });
  }
  threads.clear();
  EXPECT_EQ(made.size(), count);
}

// Whoever still has a killed process's shared memory open does not reach who makes it anew.
TEST(ManyParticipants, TakeOverThePortsOfThoseThatEndedAndOfNoneThatWasKilled) {
  constexpr std::uint32_t node_port = 10;
  constexpr std::uint32_t free_port = 10 + 2 * 57;
  const LeftPorts left(LeftPorts::By::killed,
                       {0, 1, node_port, node_port + 1, free_port, free_port + 1});
  DdsOptions node = small_memory(left);
  node.node_name = "node";
  Participant stays(node);
  for (int i = 0; i < 3; ++i) {
    SCOPED_TRACE(i);
    Participant passes(small_memory(left));
    EXPECT_TRUE(passes.self().uses_shared_memory);
    EXPECT_TRUE(left.is_there(free_port, "_el"));
    expect_large_clouds_arrive(stays, passes);
  }
  // The node still has it open.
  EXPECT_TRUE(left.is_there(free_port));
  EXPECT_FALSE(left.is_there(free_port, "_el"));
}

TEST(ManyParticipants, DoWithoutSharedMemoryWhereAllPortsAreOfThoseThatWereKilled) {
  const LeftPorts left(LeftPorts::By::killed);
  Participant a(small_memory(left));
  Participant b(small_memory(left));
  EXPECT_FALSE(a.self().uses_shared_memory);
  expect_large_clouds_arrive(a, b);
}

TEST(Network, WithoutMulticastProcessesOfOneMachineFindEachOther) {
  Participant a(without_multicast());
  Participant b(without_multicast());
  expect_large_clouds_arrive(a, b);
}

TEST(Network, WithoutMulticastNobodyIsFoundWhoIsNotLookedFor) {
  // Only a listens for multicast; b neither sends it nor knows a's port.
  DdsOptions deaf = without_multicast();
  deaf.listening_port = test_port();
  Participant a(deaf);
  DdsOptions other = without_multicast();
  other.listening_port = static_cast<std::uint16_t>(test_port() + 1);
  Participant b(other);
  EXPECT_FALSE(finds(a, b, 3s));
}

TEST(Network, APeerIsFoundAtItsPort) {
  DdsOptions server = without_multicast();
  server.listening_port = test_port();
  DdsOptions client = without_multicast();
  client.peers = {{"localhost", server.listening_port}};
  Participant a(server);
  Participant b(client);
  expect_large_clouds_arrive(a, b);
  expect_large_clouds_arrive(b, a);
}

TEST(Network, AServerWithAPortOfItsOwnUsesMulticastAndSharedMemory) {
  DdsOptions server = loopback(true);
  server.listening_port = test_port();
  Participant a(server);
  Participant b(loopback(true));
  expect_large_clouds_arrive(a, b);
}

TEST(Network, PeersAreLookedForBesideMulticast) {
  DdsOptions options = loopback(false);
  options.peers = {{"127.0.0.1", 9}};
  Participant a(options);
  Participant b(loopback(false));
  EXPECT_TRUE(finds(a, b));
}

TEST(Network, TcpClientsFindTheServer) {
  Participant a(tcp_server());
  const auto b = connected(a, tcp_client());
  ASSERT_TRUE(b);
  expect_large_clouds_arrive(a, *b);
  expect_large_clouds_arrive(*b, a);
}

TEST(Network, TcpClientsOfOneProcessAreToldApart) {
  Participant a(tcp_server());
  const auto b = connected(a, tcp_client());
  ASSERT_TRUE(b);
  const auto c = connected(a, tcp_client());
  ASSERT_TRUE(c);
  expect_large_clouds_arrive(a, *b);
  expect_large_clouds_arrive(*c, a);
  expect_large_clouds_arrive(a, *c);
  expect_large_clouds_arrive(*b, a);
}

TEST(Network, ADiscoveryServerIntroducesItsClients) {
  DdsOptions registry = loopback(false);
  registry.discovery_port = test_port();
  DdsOptions client = without_multicast();
  client.discovery_server = {"127.0.0.1", registry.discovery_port};
  Participant a(client);
  Participant b(client);
  EXPECT_FALSE(finds(a, b, 1s)) << "before there is a discovery server";
  const Participant introducer(registry);
  expect_large_clouds_arrive(a, b);
}

TEST(Network, RefusesAPortThatIsTaken) {
  DdsOptions registry = loopback(false);
  registry.discovery_port = test_port();
  const Participant first(registry);
  EXPECT_THROW(Participant second(registry), DdsError);
}

TEST(Network, RefusesAPeerWhoseNameIsNotKnown) {
  DdsOptions options = loopback(false);
  options.peers = {{"no-such-host.invalid", 0}};
  EXPECT_THROW(Participant participant(options), DdsError);
}

TEST(Network, APeerWhoseNameIsNotKnownIsLeftOutWhereItMayBe) {
  DdsOptions server = without_multicast();
  server.listening_port = test_port();
  server.peers = {{"no-such-host..invalid", 7400}, {"localhost", 7400}};
  server.unresolved_peers_allowed = true;
  DdsOptions client = without_multicast();
  client.peers = {{"localhost", server.listening_port}};
  Participant a(server);
  Participant b(client);
  EXPECT_EQ(a.unresolved_peers(), std::vector<std::string>{"no-such-host..invalid"});
  EXPECT_TRUE(b.unresolved_peers().empty());
  EXPECT_TRUE(finds(a, b));
}

TEST(Network, LargeMessagesKeepToTheirRateAndSmallMessagesOvertakeThem) {
  DdsOptions options = loopback(false);
  options.max_datagram_bytes = 1400;
  options.large_message_bytes_per_s = 1'000'000;
  Participant a(options);
  Participant b(loopback(false));
  Writer<PointCloud2> large(a, "rt/bulk", {.large_messages = true});
  Writer<PointCloud2> small(a, "rt/small", {});
  Reader<PointCloud2> large_reader(b, "rt/bulk", {});
  Reader<PointCloud2> small_reader(b, "rt/small", {});
  ASSERT_TRUE(large.readers().wait_for_any(discovery_timeout) &&
              small.readers().wait_for_any(discovery_timeout));
  const auto began = std::chrono::steady_clock::now();
  ASSERT_TRUE(large.write(cloud_of(2'000'000, 1)));
  PointCloud2 got;
  EXPECT_FALSE(large_reader.take(got, {}, 0ms)) << "a write does not wait";
  ASSERT_TRUE(small.write(cloud_of(100, 2)));
  ASSERT_TRUE(small_reader.take(got, {}, discovery_timeout));
  EXPECT_FALSE(large_reader.take(got, {}, 0ms)) << "the small one was held up";
  ASSERT_TRUE(large_reader.take(got, {}, discovery_timeout));
  EXPECT_EQ(got.data().size(), 2'000'000U);
  const auto took = std::chrono::steady_clock::now() - began;
  EXPECT_GT(took, 1500ms);
  EXPECT_LT(took, 5s * test::slowdown);
}

TEST(NetworkSettings, ReachFastDds) {
  DdsOptions options;
  options.socket_buffer_bytes = 123456;
  options.max_datagram_bytes = 1400;
  options.shared_memory_mib = 7;
  options.interfaces = {"127.0.0.1"};
  DomainParticipantQos qos;
  set_transports(options, qos);
  ASSERT_EQ(qos.transport().user_transports.size(), 2U);
  const auto udp =
      std::dynamic_pointer_cast<UDPv4TransportDescriptor>(qos.transport().user_transports[0]);
  ASSERT_NE(udp, nullptr);
  EXPECT_EQ(udp->receiveBufferSize, 123456U);
  EXPECT_EQ(udp->sendBufferSize, 123456U);
  EXPECT_EQ(udp->maxMessageSize, 1400U);
  EXPECT_EQ(udp->interfaceWhiteList, options.interfaces);
  const auto memory =
      std::dynamic_pointer_cast<SharedMemTransportDescriptor>(qos.transport().user_transports[1]);
  ASSERT_NE(memory, nullptr);
  EXPECT_EQ(memory->segment_size(), 7U << 20U);
}

TEST(NetworkSettings, TcpNeitherWaitsNorSumsUp) {
  DdsOptions options;
  options.transport = NetworkTransport::tcp;
  options.listening_port = 5100;
  options.shared_memory = false;
  DomainParticipantQos qos;
  set_transports(options, qos);
  ASSERT_EQ(qos.transport().user_transports.size(), 1U);
  const auto tcp =
      std::dynamic_pointer_cast<TCPv4TransportDescriptor>(qos.transport().user_transports[0]);
  ASSERT_NE(tcp, nullptr);
  EXPECT_TRUE(tcp->enable_tcp_nodelay);
  EXPECT_FALSE(tcp->calculate_crc);
  EXPECT_EQ(tcp->listening_ports, std::vector<std::uint16_t>{5100});
}

TEST(NetworkSettings, HeartbeatsAndRepairsFollowTheProfile) {
  DdsOptions options;
  options.heartbeat_ms = 250;
  options.repair_delay_ms = 40;
  const auto writer = writer_qos({}, options).reliable_writer_qos().times;
  EXPECT_EQ(writer.heartbeatPeriod, to_duration(250ms));
  EXPECT_EQ(writer.nackResponseDelay, to_duration(40ms));
  EXPECT_EQ(reader_qos({}, options).reliable_reader_qos().times.heartbeatResponseDelay,
            to_duration(40ms));
}

}  // namespace
}  // namespace stillmap::dds
