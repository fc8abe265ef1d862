#include <gmock/gmock.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <optional>
#include <string>
#include <thread>

#include "idl/dds/service_client.hpp"
#include "idl/dds/service_server.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// Whether the server that answers, whichever it is, says so of another one.
bool names_another(const dds::ServerStatus& status) {
  return std::ranges::any_of(status.diagnostics, [](const dds::Diagnostic& diagnostic) {
    return diagnostic.what.starts_with("another server is called 'stillmap'") &&
           diagnostic.hint.find("topics.namespace") != std::string::npos;
  });
}

TEST(Namesake, IsToldAsLongAsItIsThere) {
  const ServiceSetup setup("every");
  const ServiceSetup another("every");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  EXPECT_FALSE(names_another(client.status()));
  {
    ServerProcess second(another.server_arguments());
    EXPECT_TRUE(eventually([&] { return names_another(client.status()); }));
    second.send(SIGTERM);
    EXPECT_EQ(second.wait_for_exit(patience), 0);
  }
  EXPECT_TRUE(eventually([&] { return !names_another(client.status()); }));
}

/// Why this request was refused; empty where it was carried out.
template <typename Request>
std::string refusal_of(Request request) {
  try {
    request();
  } catch (const ServiceError& refusal) {
    return refusal.what();
  }
  return {};
}

/// What a server says to a client that does not look for others, as those of ROS 2.
template <typename Request, typename Reply>
std::string refusal_by_server(const ServiceSetup& setup,
                              const dds::ServiceSpec<Request, Reply>& service, Request request) {
  request.format_version(dds::wire_format_version);
  dds::Participant participant(setup.dds());
  dds::ServiceClient<Request, Reply> client(participant, service.in("stillmap"));
  if (!client.wait_for_server(patience)) return "no server";
  const auto reply = client.call(request, patience);
  return reply ? reply->status().reason() : "no answer";
}

TEST(Namesake, NoneChangesItsMapForARequestThatReachesBoth) {
  const ServiceSetup setup("every");
  const ServiceSetup another("every");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  const std::uint64_t map_id = client.status().map_id;
  {
    ServerProcess second(another.server_arguments());
    ASSERT_TRUE(eventually([&] { return names_another(client.status()); }));
    for (const std::string& why :
         {refusal_of([&] { client.reset(true); }), refusal_of([&] { client.save_map("a"); }),
          refusal_of([&] { client.load_map("a"); }),
          refusal_of([&] { static_cast<void>(client.localize({.guess = {}, .apply = true})); }),
          refusal_of([&] { client.restore_removed(RemovalReason::moving, {}); })}) {
      EXPECT_THAT(why, AllOf(HasSubstr("2 servers called 'stillmap'"), HasSubstr("process "),
                             HasSubstr("topics.namespace")));
    }
    EXPECT_THAT(refusal_by_server(setup, dds::services::reset, stillmap_msgs::srv::Reset_Request()),
                HasSubstr("so none carries it out"));
    EXPECT_THAT(
        refusal_by_server(setup, dds::services::save_map, stillmap_msgs::srv::SaveMap_Request()),
        HasSubstr("so none carries it out"));
    // It changes nothing, whichever looks.
    EXPECT_THAT(refusal_of([&] { static_cast<void>(client.localize({})); }),
                Not(HasSubstr("2 servers")));
    second.send(SIGTERM);
    EXPECT_EQ(second.wait_for_exit(patience), 0);
  }
  ASSERT_TRUE(eventually([&] { return !names_another(client.status()); }));
  EXPECT_EQ(client.status().map_id, map_id);
  EXPECT_NE(client.reset(true).map_id, map_id);
}

/// What a client needs of a server that does not see the other one, and so does not refuse.
struct ServerAlone {
  explicit ServerAlone(const dds::DdsOptions& options, bool answers = true)
      : participant(options),
        status(participant, dds::services::get_status.in("stillmap"),
               [answers](const auto&) -> stillmap_msgs::srv::GetStatus_Response {
                 if (!answers) std::this_thread::sleep_for(std::chrono::seconds(3));
                 return {};
               }),
        reset(participant, dds::services::reset.in("stillmap"), [this](const auto&) {
          ++resets;
          return stillmap_msgs::srv::Reset_Response();
        }) {}

  std::atomic<int> resets = 0;
  dds::Participant participant;
  dds::ServiceServer<stillmap_msgs::srv::GetStatus_Request, stillmap_msgs::srv::GetStatus_Response>
      status;
  dds::ServiceServer<stillmap_msgs::srv::Reset_Request, stillmap_msgs::srv::Reset_Response> reset;
};

TEST(Namesake, AClientThatSeesTwoSendsNoChangeToEither) {
  const ServiceSetup setup("every");
  Client client(setup.client());
  ServerAlone one(setup.dds());
  std::optional<ServerAlone> other(std::in_place, setup.dds());
  ASSERT_TRUE(eventually([&] {
    return refusal_of([&] { client.reset(); }).find("2 servers called 'stillmap'") !=
           std::string::npos;
  }));
  const int resets = one.resets + other->resets;
  EXPECT_THAT(refusal_of([&] { client.reset(); }), HasSubstr("was not sent"));
  EXPECT_EQ(one.resets + other->resets, resets);
  // One that is there no more, or hangs, keeps nobody from it.
  other.emplace(setup.dds(), false);
  EXPECT_TRUE(eventually([&] { return refusal_of([&] { client.reset(); }).empty(); }));
}

TEST(Namesake, IsNoServerOfAnotherName) {
  const ServiceSetup setup("every");
  const ServiceSetup another("every");
  another.add("topics: {namespace: upstairs}\n");
  const ServerProcess server(setup.server_arguments());
  const ServerProcess second(another.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ClientOptions upstairs = setup.client();
  upstairs.server_name = "upstairs";
  Client second_client(upstairs);
  second_client.wait_for_server(patience);
  // Longer than the status keeps what discovery told.
  EXPECT_FALSE(eventually([&] { return names_another(client.status()); }, std::chrono::seconds(3)));
}

std::vector<std::string> with(std::vector<std::string> arguments,
                              const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST(Namesake, ThatIsKilledCountsUntilItsSilenceIsNoticed) {
  const ServiceSetup setup("every");
  const ServiceSetup another("every");
  const ScratchFolder folder;
  // Longer than this test waits.
  const std::string profile = folder.file("network.yaml", "lease_s: 120\n").string();
  const ServerProcess server(with(setup.server_arguments(), {"--dds-profile", profile}));
  Client client(setup.client());
  client.wait_for_server(patience);
  {
    const ServerProcess second(with(another.server_arguments(), {"--dds-profile", profile}));
    ASSERT_TRUE(eventually([&] { return names_another(client.status()); }));
  }
  EXPECT_TRUE(eventually([&] {
    return refusal_by_server(setup, dds::services::reset, stillmap_msgs::srv::Reset_Request())
        .empty();
  }));
  EXPECT_TRUE(eventually([&] { return !names_another(client.status()); }));
}

TEST(Namesake, IsToldByADiscoveryServerToo) {
  const ServiceSetup setup("every");
  const ServiceSetup another("every");
  dds::DdsOptions options = setup.dds();
  options.shared_memory = false;
  options.discovery_port = static_cast<std::uint16_t>(21'000 + options.domain_id);
  const dds::Participant discovery_server(options);
  ClientOptions told = setup.client();
  told.dds.multicast = false;
  told.dds.discovery_server = {.host = "127.0.0.1", .port = options.discovery_port};
  const std::vector<std::string> by{"--dds-profile", "no_multicast", "--discovery-server",
                                    "127.0.0.1:" + std::to_string(options.discovery_port)};
  const ServerProcess server(with(setup.server_arguments(), by));
  Client client(told);
  client.wait_for_server(patience);
  EXPECT_FALSE(names_another(client.status()));
  const ServerProcess second(with(another.server_arguments(), by));
  EXPECT_TRUE(eventually([&] { return names_another(client.status()); }));
}

/// Without a discovery server, who comes is told of those that live alone.
TEST(Namesake, IsNotHeardOfOnceItWasKilled) {
  const ServiceSetup setup("every");
  {
    const ServerProcess killed(setup.server_arguments());
    Client client(setup.client());
    client.wait_for_server(patience);
  }
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  EXPECT_FALSE(eventually([&] { return names_another(client.status()); }, std::chrono::seconds(3)));
}

}  // namespace
}  // namespace stillmap::test
