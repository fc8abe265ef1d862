#include "clients/commands/arguments/client_arguments.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "config/loaders/config_error.hpp"

namespace stillmap::cli {
namespace {

using ::testing::ElementsAre;

struct Parsed {
  ClientArguments client;
  std::string dataset;
  CommandLine::Parsed outcome = CommandLine::Parsed::wrong_usage;
};

Parsed parse(std::vector<std::string> words) {
  Parsed parsed;
  CommandLine line("stillmap", "1", "help");
  line.root().option("DATASET", parsed.dataset, "A value by its place");
  add_client_options(line.root(), parsed.client);
  words.insert(words.begin(), "stillmap");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  parsed.outcome = line.parse(static_cast<int>(argv.size()), argv.data());
  return parsed;
}

TEST(ClientArguments, PeersAndInterfacesDoNotTakeWhatFollowsThem) {
  const Parsed parsed = parse({"--peer", "a", "--peer", "b:1,c", "city"});
  EXPECT_EQ(parsed.outcome, CommandLine::Parsed::command);
  EXPECT_EQ(parsed.dataset, "city");
  EXPECT_THAT(parsed.client.network.peers, ElementsAre("a", "b:1", "c"));
  EXPECT_EQ(parse({"--interface", "127.0.0.1", "city"}).dataset, "city");
}

TEST(ClientArguments, OverrideTheProfile) {
  const dds::DdsOptions options = parse({"--dds-profile", "wan", "--peer", "robot", "--udp-only",
                                         "--interface", "10.0.0.1", "--domain", "7"})
                                      .client.dds(DdsRole::client);
  EXPECT_EQ(options.transport, dds::NetworkTransport::tcp);
  EXPECT_THAT(options.peers, ElementsAre(dds::NetworkAddress{"robot", 5100}));
  EXPECT_FALSE(options.shared_memory);
  EXPECT_THAT(options.interfaces, ElementsAre("10.0.0.1"));
  EXPECT_EQ(options.domain_id, 7U);
}

TEST(ClientArguments, TakeTheNetworkFromTheEnvironment) {
  setenv("STILLMAP_DDS_PROFILE", "no_multicast", 1);
  setenv("STILLMAP_PEERS", "a,b:1", 1);
  setenv("STILLMAP_DISCOVERY_SERVER", "c", 1);
  const dds::DdsOptions options = parse({}).client.dds(DdsRole::client);
  unsetenv("STILLMAP_DDS_PROFILE");
  unsetenv("STILLMAP_PEERS");
  unsetenv("STILLMAP_DISCOVERY_SERVER");
  EXPECT_FALSE(options.multicast);
  EXPECT_THAT(options.peers, ElementsAre(dds::NetworkAddress{"a", 0}, dds::NetworkAddress{"b", 1}));
  EXPECT_EQ(options.discovery_server, (dds::NetworkAddress{"c", 11811}));
}

TEST(ClientArguments, RefuseAProfileThatDoesNotExist) {
  EXPECT_THROW((void)parse({"--dds-profile", "pigeon"}).client.dds(DdsRole::client), ConfigError);
}

}  // namespace
}  // namespace stillmap::cli
