#include "config/loaders/dds_profile.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <tuple>

#include "tests/config/config_files.hpp"

namespace stillmap {
namespace {

using test::refusal;
using test::shipped;
using test::write_file;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* whole_profile =
    "transport: udp\nserver_port: 7500\nshared_memory: false\nshared_memory_mib: 8\n"
    "client_shared_memory: true\n"
    "multicast: false\ninterfaces: [10.0.0.1]\npeers: [10.0.0.2, 'there:7412']\n"
    "discovery_server: 10.0.0.3\nsocket_buffer_bytes: 100000\nmax_datagram_bytes: 1400\n"
    "heartbeat_ms: 70\nrepair_delay_ms: 9\nlease_s: 33\nlarge_message_bytes_per_s: 500000\n";

TEST(DdsProfileFile, EveryFieldIsRead) {
  const DdsProfile profile = read_dds_profile(write_file("radio.yaml", whole_profile));
  EXPECT_EQ(profile.server_port, 7500);
  EXPECT_TRUE(profile.client_shared_memory);
  const dds::DdsOptions& options = profile.options;
  EXPECT_EQ(options.transport, dds::NetworkTransport::udp);
  EXPECT_FALSE(options.shared_memory);
  EXPECT_EQ(options.shared_memory_mib, 8U);
  EXPECT_FALSE(options.multicast);
  EXPECT_THAT(options.interfaces, ElementsAre("10.0.0.1"));
  EXPECT_THAT(options.peers,
              ElementsAre(dds::NetworkAddress{"10.0.0.2", 0}, dds::NetworkAddress{"there", 7412}));
  EXPECT_EQ(options.discovery_server, (dds::NetworkAddress{"10.0.0.3", 0}));
  EXPECT_EQ(options.socket_buffer_bytes, 100000U);
  EXPECT_EQ(options.max_datagram_bytes, 1400U);
  EXPECT_EQ(options.heartbeat_ms, 70U);
  EXPECT_EQ(options.repair_delay_ms, 9U);
  EXPECT_EQ(options.lease_s, 33U);
  EXPECT_EQ(options.large_message_bytes_per_s, 500000U);
}

TEST(DdsProfileFile, LanIsWhatHoldsWithoutAnyFile) {
  const dds::DdsOptions lan = load_dds_profile("lan").options;
  const dds::DdsOptions built_in;
  EXPECT_EQ(lan.transport, built_in.transport);
  EXPECT_EQ(load_dds_profile("lan").server_port, built_in.listening_port);
  EXPECT_EQ(lan.shared_memory, built_in.shared_memory);
  EXPECT_EQ(lan.shared_memory_mib, built_in.shared_memory_mib);
  EXPECT_EQ(lan.multicast, built_in.multicast);
  EXPECT_EQ(lan.interfaces, built_in.interfaces);
  EXPECT_EQ(lan.peers, built_in.peers);
  EXPECT_EQ(lan.discovery_server, built_in.discovery_server);
  EXPECT_EQ(lan.socket_buffer_bytes, built_in.socket_buffer_bytes);
  EXPECT_EQ(lan.max_datagram_bytes, built_in.max_datagram_bytes);
  EXPECT_EQ(lan.heartbeat_ms, built_in.heartbeat_ms);
  EXPECT_EQ(lan.repair_delay_ms, built_in.repair_delay_ms);
  EXPECT_EQ(lan.lease_s, built_in.lease_s);
  EXPECT_EQ(lan.large_message_bytes_per_s, built_in.large_message_bytes_per_s);
}

TEST(DdsProfileFile, OfThisMachineIsUsualWhereRosKeepsToIt) {
  EXPECT_EQ(DdsNetworkConfig().profile, "lan");
  for (const auto& [variable, value, profile] :
       {std::tuple("ROS_LOCALHOST_ONLY", "1", "host"),
        std::tuple("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST", "no_multicast")}) {
    ASSERT_EQ(setenv(variable, value, 1), 0);
    EXPECT_EQ(DdsNetworkConfig().profile, profile);
    ASSERT_EQ(setenv(variable, "0", 1), 0);
    EXPECT_EQ(DdsNetworkConfig().profile, "lan");
    ASSERT_EQ(unsetenv(variable), 0);
  }
}

TEST(DdsProfileFile, ShippedProfilesAreWhatTheirNamesSay) {
  EXPECT_THAT(load_dds_profile("host").options.interfaces, ElementsAre("127.0.0.1"));
  EXPECT_LE(load_dds_profile("wifi").options.max_datagram_bytes, 1472U);
  EXPECT_GT(load_dds_profile("wifi").options.large_message_bytes_per_s, 0U);
  EXPECT_EQ(load_dds_profile("wan").options.transport, dds::NetworkTransport::tcp);
  EXPECT_FALSE(load_dds_profile("no_multicast").options.multicast);
}

TEST(DdsProfileFile, TellsTheNewNameOfARenamedField) {
  const auto file = write_file("old.yaml", "bulk_bytes_per_s: 500000\n");
  EXPECT_THAT(refusal([&] { (void)read_dds_profile(file); }),
              HasSubstr("is now called 'large_message_bytes_per_s'"));
}

TEST(DdsProfileFile, TellsNoNewNameThatItRefusesItself) {
  const auto file = write_file("areas.yaml", "areas: {profiles: []}\n");
  EXPECT_THAT(refusal([&] { (void)read_dds_profile(file); }),
              AllOf(HasSubstr("areas: there is no such field"), Not(HasSubstr("is now called"))));
}

TEST(DdsProfileFile, TellsAllFaultsAtOnce) {
  const auto file = write_file("bad.yaml",
                               "transport: pigeon\nmulticast: maybe\ninterfaces: [eth0]\n"
                               "peers: ['a b', 'c:99999']\nheartbeat_ms: 0\nspeed: 3\n");
  EXPECT_THAT(refusal([&] { (void)read_dds_profile(file); }),
              AllOf(HasSubstr("bad.yaml:1: transport"), HasSubstr("multicast: 'maybe'"),
                    HasSubstr("'eth0'"), HasSubstr("'a b'"), HasSubstr("'c:99999'"),
                    HasSubstr("heartbeat_ms"), HasSubstr("speed: there is no such field")));
}

TEST(DdsProfileFile, RefusesWhatDoesNotFitTogether) {
  const auto refusal_of = [](const std::string& text) {
    return refusal([&] { (void)read_dds_profile(write_file("bad.yaml", text)); });
  };
  EXPECT_THAT(refusal_of("transport: tcp\n"), HasSubstr("server_port"));
  EXPECT_THAT(refusal_of("transport: tcp\nserver_port: 1\ndiscovery_server: a\n"),
              HasSubstr("UDP only"));
  EXPECT_THAT(refusal_of("large_message_bytes_per_s: 1000\n"), HasSubstr("20 datagrams"));
}

TEST(DdsProfileFile, IsFoundInTheFolderOfTheEnvironmentFirst) {
  const auto file = write_file("lan.yaml", "heartbeat_ms: 77\n");
  setenv("STILLMAP_DDS_PROFILES", file.parent_path().c_str(), 1);
  EXPECT_EQ(load_dds_profile("lan").options.heartbeat_ms, 77U);
  unsetenv("STILLMAP_DDS_PROFILES");
  EXPECT_EQ(load_dds_profile("lan").options.heartbeat_ms, 50U);
  EXPECT_THAT(refusal([] { (void)load_dds_profile("carrier_pigeon"); }),
              AllOf(HasSubstr("carrier_pigeon"), HasSubstr("no_multicast")));
}

TEST(NetworkAddressText, IsHostOrHostAndPort) {
  EXPECT_EQ(network_address_from("robot.local"), (dds::NetworkAddress{"robot.local", 0}));
  EXPECT_EQ(network_address_from("10.1.2.3:80"), (dds::NetworkAddress{"10.1.2.3", 80}));
  for (const char* text : {"", ":80", "a:", "a:0", "a:x", "a:70000", "a:-1", "::1", "a b", "a/b"}) {
    EXPECT_EQ(network_address_from(text), std::nullopt) << text;
  }
}

TEST(DdsNetworkConfigTest, ADeploymentOverridesItsProfile) {
  const DdsNetworkConfig network{.profile = write_file("radio.yaml", whole_profile).string(),
                                 .shared_memory = true,
                                 .interfaces = {"10.0.0.9"},
                                 .peers = {"a", "b:1"},
                                 .discovery_server = "c:2",
                                 .socket_buffer_bytes = 70000};
  const dds::DdsOptions client = dds_options(network, DdsRole::client);
  EXPECT_TRUE(client.shared_memory);
  EXPECT_THAT(client.interfaces, ElementsAre("10.0.0.9"));
  EXPECT_THAT(client.peers,
              ElementsAre(dds::NetworkAddress{"a", 7500}, dds::NetworkAddress{"b", 1}));
  EXPECT_EQ(client.discovery_server, (dds::NetworkAddress{"c", 2}));
  EXPECT_EQ(client.socket_buffer_bytes, 70000U);
  EXPECT_EQ(client.listening_port, 0);
  EXPECT_EQ(dds_options(network, DdsRole::server).listening_port, 7500);
}

TEST(DdsNetworkConfigTest, OnlySensorsAndTheServerShareMemoryWhereClientsMayHang) {
  DdsNetworkConfig lan;
  EXPECT_TRUE(dds_options(lan, DdsRole::server).shared_memory);
  EXPECT_TRUE(dds_options(lan, DdsRole::sensor).shared_memory);
  EXPECT_FALSE(dds_options(lan, DdsRole::client).shared_memory);
  lan.shared_memory = true;
  EXPECT_TRUE(dds_options(lan, DdsRole::client).shared_memory);
  DdsNetworkConfig host;
  host.profile = "host";
  EXPECT_TRUE(dds_options(host, DdsRole::client).shared_memory);
}

TEST(DdsNetworkConfigTest, WhatIsNotGivenStaysAsTheProfileHasIt) {
  DdsNetworkConfig network;
  network.profile = write_file("radio.yaml", whole_profile).string();
  const dds::DdsOptions options = dds_options(network, DdsRole::client);
  EXPECT_FALSE(options.shared_memory);
  EXPECT_THAT(options.interfaces, ElementsAre("10.0.0.1"));
  EXPECT_EQ(options.peers.size(), 2U);
  EXPECT_EQ(options.discovery_server, (dds::NetworkAddress{"10.0.0.3", 11811}));
  EXPECT_EQ(options.socket_buffer_bytes, 100000U);
}

TEST(DdsNetworkConfigTest, TellsAllFaultsAtOnce) {
  DdsNetworkConfig network;
  network.profile = "wan";
  network.interfaces = {"eth0"};
  network.peers = {"a:b"};
  network.discovery_server = "c:d";
  EXPECT_THAT(
      refusal([&] { (void)dds_options(network, DdsRole::client); }),
      AllOf(HasSubstr("'eth0'"), HasSubstr("'a:b'"), HasSubstr("'c:d'"), HasSubstr("over TCP")));
}

}  // namespace
}  // namespace stillmap
