#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <memory>
#include <thread>
#include <vector>

#include "idl/dds/dds_error.hpp"
#include "idl/dds/reader.hpp"
#include "idl/dds/security/authority.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/roles.hpp"
#include "idl/interface/topics.hpp"
#include "sensor_msgs.h"
#include "tests/clients/process.hpp"
#include "tests/scratch_folder.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Field;
using ::testing::HasSubstr;

/// A server in a secured domain, and identities of all roles.
class SecuredDomain : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path identity(const std::string& name) const {
    return folder_ / "keys" / name;
  }

  [[nodiscard]] dds::DdsOptions dds(const std::filesystem::path& security) const {
    dds::DdsOptions options = setup_.dds();
    options.security = security;
    return options;
  }

  [[nodiscard]] Client client(const std::filesystem::path& security,
                              std::chrono::milliseconds timeout = patience) const {
    ClientOptions options = setup_.client();
    options.dds.security = security;
    options.request_timeout = timeout;
    return Client(options);
  }

  [[nodiscard]] ScanPublisher publisher(const std::filesystem::path& security) const {
    return ScanPublisher({.dds = dds(security), .lossless = true});
  }

  /// `stillmap ARGUMENTS` in the server's domain.
  [[nodiscard]] ProcessResult run(const std::string& arguments) const {
    return run_stillmap(
        arguments + " --interface 127.0.0.1 --domain " + std::to_string(setup_.dds().domain_id),
        folder_.path());
  }

  [[nodiscard]] std::string server_command(const std::filesystem::path& security) const {
    std::string command = stillmap_server_program();
    for (const std::string& word : setup_.server_arguments()) command += " " + word;
    return command + " --security " + security.string();
  }

  void start_server() {
    server_.emplace(server_command(identity("server")), folder_ / "server.log");
  }

  /// An identity of an authority that the server does not know.
  [[nodiscard]] std::filesystem::path stranger() const {
    const dds::Authority other = dds::Authority::make(folder_ / "other", 10);
    return other.add("planner", "planner", dds::access_of(dds::Role::planner, {}),
                     dds::Validity::days_from_now(5));
  }

  ScratchFolder folder_;
  ServiceSetup setup_{"every"};
  ProcessResult made_ =
      run_stillmap("security init " + (folder_ / "keys").string(), folder_.path());
  std::optional<BackgroundProcess> server_;
};

/// Counts what comes on a topic.
class Listener {
 public:
  Listener(const dds::DdsOptions& dds, const std::string& topic)
      : participant_(dds), reader_(participant_, topic, {.reliable = false}) {}

  /// Handshakes of many participants take their time, and what is sent meanwhile is not heard.
  [[nodiscard]] bool hears_somebody() const { return reader_.events().wait_for_writer(patience); }
  [[nodiscard]] int samples() {
    sensor_msgs::msg::PointCloud2 cloud;
    while (reader_.take(cloud, {}, 0ms)) ++samples_;
    return samples_;
  }

 private:
  dds::Participant participant_;
  dds::Reader<sensor_msgs::msg::PointCloud2> reader_;
  int samples_ = 0;
};

/// One of many in a domain, with a writer that the others see once they have authenticated it.
class Member {
 public:
  explicit Member(const dds::DdsOptions& dds)
      : participant_(dds), writer_(participant_, "rt/points", {}) {}

  [[nodiscard]] std::ptrdiff_t others_authenticated() const {
    return std::ranges::count_if(
        participant_.remote_participants(),
        [](const dds::RemoteParticipant& other) { return !other.endpoints.empty(); });
  }

 private:
  dds::Participant participant_;
  dds::Writer<sensor_msgs::msg::PointCloud2> writer_;
};

// In each of them, several threads discover others at the same time.
TEST_F(SecuredDomain, AuthenticatesEachOfManyWhoComeAtOnce) {
  constexpr int members = 16;
  dds::DdsOptions options = dds(identity("sensor"));
  options.shared_memory_mib = 4;
  std::vector<std::unique_ptr<Member>> all;
  for (int i = 0; i < members; ++i) all.push_back(std::make_unique<Member>(options));
  EXPECT_TRUE(eventually([&] {
    return std::ranges::all_of(
        all, [](const auto& one) { return one->others_authenticated() == members - 1; });
  }));
}

TEST_F(SecuredDomain, IsDeafAndMuteToAnOutsider) {
  ASSERT_EQ(made_.exit_code, 0) << made_.err;
  start_server();
  constexpr int scans = 6;
  const std::string labelled = dds::Topics::in("stillmap").scan.dds_name;
  Listener outside(dds({}), labelled), inside(dds(identity("planner")), labelled);
  Listener outside_points(dds({}), "rt/points"),
      inside_points(dds(identity("planner")), "rt/points");
  Client planner = client(identity("planner"));
  planner.wait_for_server(patience);
  const std::uint64_t map_id = planner.status().map_id;

  // The outsider sends first, so that it has all the time there is.
  ScanPublisher intruder(ScanPublisherOptions{.dds = dds({})});
  ScanPublisher sensor = publisher(identity("sensor"));
  Client intruding = client({}, 1500ms * slowdown);
  ASSERT_TRUE(intruder.publish(room_scan(0)));
  // Until the server is discovered, nobody can say why there is no answer.
  std::string why;
  EXPECT_TRUE(eventually([&] {
    why = message_of<ServiceTimeout>([&] { (void)intruding.reset(); });
    return why.find("is secured") != std::string::npos;
  })) << why;
  EXPECT_THAT(why, HasSubstr("--security"));
  ASSERT_TRUE(intruder.publish(room_scan(1)));
  // The other outsider listens, and nobody else.
  EXPECT_LE(intruder.subscribers(), 1);

  ASSERT_TRUE(inside.hears_somebody());
  ASSERT_TRUE(inside_points.hears_somebody());
  drive(sensor, 0, scans);
  ASSERT_TRUE(wait_for_scans(planner, scans));
  EXPECT_TRUE(eventually([&] { return inside.samples() > 0 && inside_points.samples() > 0; }));
  EXPECT_EQ(outside.samples(), 0);
  // It hears the two scans of the other outsider at most.
  EXPECT_LE(outside_points.samples(), 2);
  const dds::ServerStatus status = planner.status();
  EXPECT_EQ(status.counter("scans_received"), static_cast<std::uint64_t>(scans));
  EXPECT_EQ(status.map_id, map_id);
  EXPECT_THAT(status.diagnostics,
              Contains(Field(&dds::Diagnostic::what, HasSubstr("is not secured and is ignored"))));
}

TEST_F(SecuredDomain, LetsAPlannerAskAndAnOperatorCommand) {
  start_server();
  ScanPublisher sensor = publisher(identity("sensor"));
  drive(sensor, 0, 4);
  Client planner = client(identity("planner"));
  ASSERT_TRUE(wait_for_scans(planner, 4));
  EXPECT_TRUE(eventually([&] { return !planner.get_static_map({}).voxels.empty(); }));
  const std::uint64_t map_id = planner.status().map_id;
  EXPECT_THAT(
      message_of<ServiceError>([&] { (void)planner.reset(); }),
      AllOf(HasSubstr("stillmap/reset"), HasSubstr("refused by the permissions of this domain"),
            HasSubstr("'planner' (role planner)")));
  EXPECT_THROW((void)planner.save_map(), ServiceError);
  EXPECT_EQ(planner.status().map_id, map_id);

  const ProcessResult refused = run("reset --security " + identity("planner").string());
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("refused by the permissions of this domain"));
  const ProcessResult reset = run("reset --security " + identity("operator").string());
  EXPECT_EQ(reset.exit_code, 0) << reset.err;
  EXPECT_NE(planner.status().map_id, map_id);
}

TEST_F(SecuredDomain, LetsNobodyButASensorSendScans) {
  for (const std::string name : {"planner", "operator"}) {
    EXPECT_THAT(message_of<dds::NotPermitted>([&] { (void)publisher(identity(name)); }),
                AllOf(HasSubstr("may not write rt/points"), HasSubstr(name)));
  }
  EXPECT_NO_THROW((void)publisher(identity("sensor")));
}

// Which side gets the other's certificate first, and refuses it, goes by the guids. The other side
// only sees that there is no answer.
TEST_F(SecuredDomain, RefusesAnotherAuthorityAndSaysSoOnBothSides) {
  const std::string refused = "refuse each other", unanswered = "have not authenticated each other";
  const auto is_told = [&](const std::string& text) {
    return text.find(refused) != std::string::npos || text.find(unanswered) != std::string::npos;
  };
  start_server();
  const std::filesystem::path foreign = stranger();
  Client planner = client(identity("planner"));
  planner.wait_for_server(patience);
  Client intruder = client(foreign, 3s * slowdown);
  std::string why, log;
  const auto eventually_says = [&](const auto& condition) {
    return eventually([&] {
      why = message_of<ServiceTimeout>([&] { (void)intruder.status(); });
      log = content_of(folder_ / "server.log");
      return condition();
    });
  };
  EXPECT_TRUE(eventually_says([&] { return is_told(why) && is_told(log); })) << why << log;
  EXPECT_TRUE(eventually_says([&] { return (why + log).find(refused) != std::string::npos; }))
      << why << log;
  EXPECT_THAT(planner.status().diagnostics,
              Contains(Field(&dds::Diagnostic::evidence, HasSubstr("another authority"))));
}

TEST_F(SecuredDomain, DoesNotStartWithAnIdentityThatExpired) {
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  const dds::Validity past{.from = now - std::chrono::days(9), .to = now - std::chrono::days(2)};
  const dds::Authority authority = dds::Authority::open(folder_ / "keys");
  for (const dds::Role role : {dds::Role::server, dds::Role::planner}) {
    (void)authority.add(std::string(name(role)), std::string(name(role)), dds::access_of(role, {}),
                        past, true);
  }
  start_server();
  EXPECT_EQ(server_->wait(), 2);
  EXPECT_THAT(content_of(folder_ / "server.log"),
              AllOf(HasSubstr("server/cert.pem expired on"), HasSubstr("security add")));
  const ProcessResult asked = run("status --security " + identity("planner").string());
  EXPECT_EQ(asked.exit_code, 2);
  EXPECT_THAT(asked.err, HasSubstr("planner/cert.pem expired on"));
  const ProcessResult checked =
      run_stillmap("security check " + (folder_ / "keys").string(), folder_.path());
  EXPECT_EQ(checked.exit_code, 1);
  EXPECT_THAT(checked.out, AllOf(HasSubstr("FAULT   "), HasSubstr("operator: ok")));
  const ProcessResult renewed = run_stillmap(
      "security add " + (folder_ / "keys").string() + " server --replace", folder_.path());
  EXPECT_EQ(renewed.exit_code, 0) << renewed.err;
  EXPECT_THAT(renewed.out, HasSubstr("a server, valid until"));
}

TEST_F(SecuredDomain, ChecksTheOthersBesideACertificateThatCannotBeRead) {
  std::ofstream(identity("planner") / "cert.pem", std::ios::trunc) << "nonsense\n";
  const ProcessResult checked =
      run_stillmap("security check " + (folder_ / "keys").string(), folder_.path());
  EXPECT_EQ(checked.exit_code, 1) << checked.err;
  EXPECT_THAT(checked.out, AllOf(HasSubstr("planner/cert.pem is no certificate"),
                                 HasSubstr("operator: ok"), HasSubstr("server: ok")));
}

TEST_F(SecuredDomain, IsMadeWholeOrNotAtAll) {
  const std::filesystem::path keys = folder_ / "halves";
  std::filesystem::create_directories(keys / "planner");
  const std::string init = "security init " + keys.string();
  const ProcessResult refused = run_stillmap(init, folder_.path());
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("halves/planner exists"));
  EXPECT_FALSE(std::filesystem::exists(keys / "authority"));
  EXPECT_FALSE(std::filesystem::exists(keys / "server"));
  EXPECT_TRUE(std::filesystem::exists(keys / "planner"));
  std::filesystem::remove(keys / "planner");
  const ProcessResult made = run_stillmap(init, folder_.path());
  EXPECT_EQ(made.exit_code, 0) << made.err;
}

TEST_F(SecuredDomain, LetsTheServerReadSeveralLidars) {
  const std::filesystem::path keys = folder_ / "lidars";
  const ProcessResult made = run_stillmap(
      "security init " + keys.string() + " --points front/points rear/points", folder_.path());
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const ServiceSetup setup("every", "save_period_s: 3600",
                           "frames: {base: base_link}\n"
                           "sensors:\n"
                           "  - {name: front, sensor: vlp_16, topic: front/points}\n"
                           "  - {name: rear, sensor: vlp_16, topic: rear/points}");
  std::string command = stillmap_server_program();
  for (const std::string& word : setup.server_arguments()) command += " " + word;
  const BackgroundProcess server(command + " --security " + (keys / "server").string(),
                                 folder_ / "server.log");
  Client planner = client(keys / "planner");
  planner.wait_for_server(patience);
  const std::filesystem::path sensor = keys / "sensor";
  ScanPublisher front({.dds = dds(sensor), .points_topic = "front/points", .lossless = true});
  ScanPublisher rear({.dds = dds(sensor), .points_topic = "rear/points", .lossless = true});
  EXPECT_TRUE(front.wait_for_subscriber(patience)) << content_of(folder_ / "server.log");
  EXPECT_TRUE(rear.wait_for_subscriber(patience)) << content_of(folder_ / "server.log");
}

}  // namespace
}  // namespace stillmap::test
