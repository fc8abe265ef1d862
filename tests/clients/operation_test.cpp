// Operation of the real programs: metrics, health, logs, signals.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <chrono>
#include <csignal>
#include <map>
#include <memory>
#include <regex>
#include <sstream>
#include <stdexcept>
#include <thread>
#include <vector>

#include "tests/clients/command_test.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::test {
namespace {

sockaddr_in loopback_port(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

/// A TCP port of 127.0.0.1, held until this goes.
class HeldPort {
 public:
  HeldPort() : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address = loopback_port(0);
    socklen_t size = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    if (bind(socket_, generic, size) != 0 || listen(socket_, 1) != 0 ||
        getsockname(socket_, generic, &size) != 0) {
      throw std::runtime_error("no free port on 127.0.0.1");
    }
    number_ = ntohs(address.sin_port);
  }
  ~HeldPort() { close(socket_); }
  HeldPort(const HeldPort&) = delete;
  HeldPort& operator=(const HeldPort&) = delete;
  [[nodiscard]] int number() const { return number_; }

 private:
  int socket_ = -1;
  int number_ = 0;
};

/// Body of the answer to GET `path` from a server on this machine; empty when there is none or it
/// is not "200 OK".
std::string http_get(int port, const std::string& path) {
  const int connection = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const sockaddr_in address = loopback_port(port);
  std::string answer;
  if (connect(connection, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    const std::string request = "GET " + path + " HTTP/1.0\r\nHost: localhost\r\n\r\n";
    ssize_t got = write(connection, request.data(), request.size());
    std::array<char, 4096> part{};
    while (got > 0) {
      got = read(connection, part.data(), part.size());
      if (got > 0) answer.append(part.data(), static_cast<std::size_t>(got));
    }
  }
  close(connection);
  const std::size_t body = answer.find("\r\n\r\n");
  const bool is_ok = answer.starts_with("HTTP/1.") && answer.substr(8, 4) == " 200";
  return is_ok && body != std::string::npos ? answer.substr(body + 4) : "";
}

class OperationTest : public CommandTest {
 protected:
  [[nodiscard]] std::string on_domain() const { return " --domain " + std::to_string(domain_); }

  [[nodiscard]] std::string server_command(const std::string& more = "") const {
    return stillmap_server_program() + " --map-file " + path("server.stillmap") + on_domain() +
           " " + more;
  }

  [[nodiscard]] std::size_t count_in(const std::string& log_file, const std::string& text) const {
    const std::string log = content(log_file);
    std::size_t count = 0;
    for (auto at = log.find(text); at != std::string::npos; at = log.find(text, at + 1)) ++count;
    return count;
  }

  /// Waits until the program that logs there printed the text so many times.
  [[nodiscard]] bool comes_to_say(const std::string& text, const std::string& log_file,
                                  std::size_t times = 1) const {
    return eventually([&] { return count_in(log_file, text) >= times; });
  }

  [[nodiscard]] bool answers() const {
    return run("status" + patiently() + on_domain()).exit_code == 0;
  }

  int domain_ = free_domain();
};

/// Samples of an exposition by name and labels as they are written. Fails the test for a line that
/// is none, or whose family has no type.
std::map<std::string, double> samples_of(const std::string& exposition) {
  static const std::regex sample(
      R"re(([a-zA-Z_:][a-zA-Z0-9_:]*)(\{[a-z_]+="[^"\\]*"(,[a-z_]+="[^"\\]*")*\})? (\S+))re");
  static const std::regex type(R"(# TYPE (\S+) (counter|gauge|histogram|summary))");
  std::map<std::string, double> samples;
  std::map<std::string, std::string> types;
  std::istringstream lines(exposition);
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (std::regex_match(line, match, type)) {
      types[match[1]] = match[2];
    } else if (!line.starts_with("# HELP ")) {
      EXPECT_TRUE(std::regex_match(line, match, sample)) << line;
      const std::string family =
          std::regex_replace(match[1].str(), std::regex("_(bucket|sum|count)$"), "");
      EXPECT_TRUE(types.contains(match[1]) || types.contains(family)) << line;
      samples[match[1].str() + match[2].str()] = std::stod(match[4]);
    }
  }
  return samples;
}

TEST_F(OperationTest, MetricsMoveWithScansAndRequests) {
  simulate("city", 8);
  const int port = HeldPort().number();
  BackgroundProcess server(
      server_command("--delivery every --metrics 127.0.0.1:" + std::to_string(port)),
      folder_ / "server.log");
  ASSERT_TRUE(answers()) << content("server.log");
  auto before = samples_of(http_get(port, "/metrics"));
  EXPECT_EQ(before.at("stillmap_scans_mapped_total"), 0.0);
  ASSERT_EQ(run("replay " + path("city") + " --lossless" + patiently() + on_domain()).exit_code, 0);
  ASSERT_EQ(run("save" + on_domain()).exit_code, 0);
  auto after = samples_of(http_get(port, "/metrics"));
  EXPECT_EQ(after.at("stillmap_scans_received_total"), 8.0);
  EXPECT_EQ(after.at("stillmap_scans_mapped_total"), 8.0);
  EXPECT_EQ(after.at(R"(stillmap_stage_duration_seconds_bucket{stage="total",le="+Inf"})"), 8.0);
  EXPECT_EQ(after.at(R"(stillmap_stage_duration_seconds_count{stage="odometry"})"), 8.0);
  EXPECT_GT(after.at(R"(stillmap_stage_duration_seconds_sum{stage="total"})"), 0.0);
  const std::string status_answers =
      R"(stillmap_service_requests_total{code="ok",service="stillmap/get_status"})";
  EXPECT_GT(after.at(status_answers), before.at(status_answers));
  EXPECT_EQ(after.at(R"(stillmap_service_requests_total{code="ok",service="stillmap/save_map"})"),
            1.0);
  EXPECT_GE(after.at("stillmap_checkpoint_duration_seconds_count"), 1.0);
  EXPECT_GT(after.at("stillmap_checkpoint_last_success_timestamp_seconds"), 1.6e9);
  EXPECT_GT(after.at("stillmap_map_voxels"), 0.0);
  EXPECT_GT(after.at("process_resident_memory_bytes"), 1e7);
  EXPECT_EQ(http_get(port, "/elsewhere"), "");
  EXPECT_EQ(server.stop(), 0) << content("server.log");
  EXPECT_EQ(http_get(port, "/metrics"), "");
}

// The server's messages for a client that hangs pile up in shared memory. When it is killed they
// stay there, and Fast DDS gives the next client the same ports. The witness counts the messages.
TEST_F(OperationTest, AnswersNewClientsAfterOthersHungAndWereKilled) {
  BackgroundProcess server(server_command("--log-level warning"), folder_ / "server.log");
  ASSERT_TRUE(answers()) << content("server.log");
  const BackgroundProcess witness(stillmap_program() + " watch --json" + on_domain(),
                                  folder_ / "witness.log");
  for (int round = 0; round < 2; ++round) {
    std::vector<std::unique_ptr<BackgroundProcess>> clients;
    for (int i = 0; i < 4; ++i) {
      const std::string name = "watch" + std::to_string(i) + ".log";
      clients.push_back(std::make_unique<BackgroundProcess>(
          stillmap_program() + " watch --json" + on_domain(), folder_ / name));
      ASSERT_TRUE(comes_to_say("\"status\"", name)) << round;
    }
    for (const auto& client : clients) client->send(SIGSTOP);
    const std::size_t before = count_in("witness.log", "\"status\"");
    ASSERT_TRUE(comes_to_say("\"status\"", "witness.log", before + 4)) << round;
    for (const auto& client : clients) client->send(SIGKILL);
    for (const auto& client : clients) EXPECT_EQ(client->wait(), -1);
    EXPECT_TRUE(answers()) << round;
  }
  EXPECT_EQ(server.stop(), 0) << content("server.log");
  static_cast<void>(run("doctor --clean --listen 1" + on_domain()));
}

TEST_F(OperationTest, AMetricsPortThatIsTakenIsNamed) {
  const HeldPort held;
  const std::string address = "127.0.0.1:" + std::to_string(held.number());
  BackgroundProcess server(server_command("--metrics " + address), folder_ / "server.log");
  EXPECT_EQ(server.wait(), 1);
  EXPECT_THAT(content("server.log"), AllOf(HasSubstr(address), HasSubstr("taken")));
  BackgroundProcess nonsense(server_command("--metrics everywhere"), folder_ / "nonsense.log");
  EXPECT_EQ(nonsense.wait(), 2);
  EXPECT_THAT(content("nonsense.log"), HasSubstr("'everywhere' is not an IP address"));
}

TEST_F(OperationTest, HealthSaysWhetherTheServerAnswersAndMaps) {
  const ProcessResult nobody = run("health --timeout 0.5" + on_domain());
  EXPECT_EQ(nobody.exit_code, 1);
  EXPECT_THAT(nobody.out, AllOf(HasSubstr("unhealthy: "), HasSubstr(std::to_string(domain_))));
  BackgroundProcess server(server_command(), folder_ / "server.log");
  const ProcessResult alive = run("health" + patiently() + on_domain());
  EXPECT_EQ(alive.exit_code, 0) << alive.out;
  EXPECT_THAT(alive.out, testing::StartsWith("healthy: "));
  EXPECT_THAT(run("health --json" + patiently() + on_domain()).out, HasSubstr("\"healthy\": true"));
  const ProcessResult idle = run("health --mapping" + patiently() + on_domain());
  EXPECT_EQ(idle.exit_code, 1);
  EXPECT_THAT(idle.out, HasSubstr("unhealthy: no scans arrive"));
  EXPECT_EQ(server.stop(), 0);
}

TEST_F(OperationTest, ADiskWithoutRoomIsUnhealthyUntilThereIsSome) {
  simulate("city", 20);
  write("server.yaml", "sensor: vlp_16\nmap: {save_period_s: 0.2}\n");
  BackgroundProcess server(server_command("--delivery every --config " + path("server.yaml")),
                           folder_ / "server.log");
  ASSERT_TRUE(answers());
  std::istringstream lock(content("server.stillmap.lock"));
  std::string host;
  pid_t pid = 0;
  ASSERT_TRUE(lock >> host >> pid);
  const auto limit_files_to = [&](rlim_t bytes) {
    const rlimit limit{.rlim_cur = bytes, .rlim_max = RLIM_INFINITY};
    ASSERT_EQ(prlimit(pid, RLIMIT_FSIZE, &limit, nullptr), 0);
  };
  const auto becomes = [&](int exit_code) {
    ProcessResult health;
    EXPECT_TRUE(eventually([&] {
      health = run("health" + patiently() + on_domain());
      return health.exit_code == exit_code;
    })) << health.out;
    return health.out;
  };
  becomes(0);
  limit_files_to(60'000);
  ASSERT_EQ(run("replay " + path("city") + " --lossless" + on_domain()).exit_code, 0);
  EXPECT_THAT(becomes(1),
              AllOf(HasSubstr("checkpoints in a row failed"), HasSubstr(path("server.stillmap"))));
  const nlohmann::json status = nlohmann::json::parse(run("status --json" + on_domain()).out);
  EXPECT_GT(status.at("counters").at("checkpoints_failing"), 0);
  EXPECT_THAT(status.at("reason"), HasSubstr("cannot be saved"));
  limit_files_to(RLIM_INFINITY);
  becomes(0);
  EXPECT_EQ(server.stop(), 0);
  EXPECT_EQ(run("map-check " + path("server.stillmap")).exit_code, 0);
}

TEST_F(OperationTest, ChecksAConfigurationWithoutStarting) {
  write("good.yaml", "sensor: vlp_16\nlabels: {source: none}\n");
  write("bad.yaml",
        "sensor: vlp_61\nmap: {save_period_s: -1}\nmetrics: {address: x}\nlog: {level: all}\n");
  write("no_model.yaml", "labels: {model: missing}\n");
  const auto check = [&](const std::string& file) {
    BackgroundProcess server(stillmap_server_program() + " --check-config " + path(file),
                             folder_ / "check.log");
    return server.wait();
  };
  EXPECT_EQ(check("good.yaml"), 0) << content("check.log");
  EXPECT_THAT(content("check.log"),
              AllOf(HasSubstr("can be used"), HasSubstr("not the default: sensor")));
  EXPECT_THAT(content("check.log"), Not(HasSubstr("map.file")));
  write("good.yaml", "labels: {source: none}\nmap: {file: unmounted/city.stillmap}\n");
  EXPECT_EQ(check("good.yaml"), 0) << content("check.log");
  EXPECT_THAT(content("check.log"),
              AllOf(HasSubstr("map.file"), HasSubstr("unmounted"), HasSubstr("is not there yet")));
  // One that cannot be looked at by whoever checks may be there for the server.
  std::filesystem::create_symlink(path("loop"), path("loop"));
  write("good.yaml", "labels: {source: none}\nmap: {file: loop/city.stillmap}\n");
  EXPECT_EQ(check("good.yaml"), 0) << content("check.log");
  EXPECT_THAT(content("check.log"), Not(HasSubstr("map.file: ")));
  EXPECT_EQ(check("bad.yaml"), 2);
  EXPECT_THAT(content("check.log"), AllOf(HasSubstr("vlp_61"), HasSubstr("save_period_s"),
                                          HasSubstr("metrics.address"), HasSubstr("log.level")));
  EXPECT_EQ(check("no_model.yaml"), 2);
  EXPECT_THAT(content("check.log"), HasSubstr("missing"));
  write("no_identity.yaml", "labels: {source: none}\ndds: {security: absent}\n");
  EXPECT_EQ(check("no_identity.yaml"), 2);
  EXPECT_THAT(content("check.log"), AllOf(HasSubstr("absent"), Not(HasSubstr("can be used"))));
}

TEST_F(OperationTest, NamesTheOptionThatWasMeant) {
  BackgroundProcess server(stillmap_server_program() + " --deliver every", folder_ / "log");
  EXPECT_EQ(server.wait(), 2);
  EXPECT_THAT(content("log"), AllOf(HasSubstr("not expected here: --deliver every\n"),
                                    HasSubstr("Did you mean '--delivery'?")));
}

TEST_F(OperationTest, WithoutStandardErrorTheLogGoesIntoNoFileOfTheMap) {
  BackgroundProcess server("sh -c 'exec " + server_command() + " 2>&-'", folder_ / "server.log");
  ASSERT_TRUE(answers());
  EXPECT_THAT(content("server.stillmap.lock"), testing::Not(HasSubstr("info")));
  EXPECT_EQ(server.stop(), 0);
}

TEST_F(OperationTest, LogsByLevelAndForTheJournalWithoutASecondClock) {
  const auto log_of = [&](const std::string& environment, const std::string& options) {
    write("server.log", "");
    BackgroundProcess server("env " + environment + " " + server_command(options),
                             folder_ / "server.log");
    EXPECT_TRUE(answers());
    EXPECT_EQ(server.stop(), 0);
    return content("server.log");
  };
  const std::string plain = log_of("-u JOURNAL_STREAM", "");
  EXPECT_THAT(plain, testing::ContainsRegex("20[0-9]+-[0-9]+-[0-9]+T[0-9:.+]+ info ready: "));
  const std::string journal =
      log_of("JOURNAL_STREAM=$(stat -c %d:%i " + path("server.log") + ")", "");
  EXPECT_THAT(journal, testing::ContainsRegex("(^|\n)<6>ready: "));
  EXPECT_THAT(journal, testing::Not(HasSubstr(" info ")));
  EXPECT_THAT(log_of("-u JOURNAL_STREAM", "--log-level debug"), HasSubstr("get_status: ok in "));
  const std::string quiet = log_of("STILLMAP_LOG_LEVEL=error", "");
  EXPECT_THAT(quiet, testing::Not(HasSubstr("ready")));
  EXPECT_THAT(log_of("STILLMAP_LOG_LEVEL=error", "--log-level info"), HasSubstr("ready"));
}

TEST_F(OperationTest, SavesTheMapWithinWhatDockerWaits) {
  simulate("city", 30);
  BackgroundProcess server(server_command("--delivery every"), folder_ / "server.log");
  ASSERT_TRUE(answers()) << content("server.log");
  // Slow enough that a busy machine finds the time to ask while scans still come.
  BackgroundProcess replay(stillmap_program() + " replay " + path("city") +
                               " --lossless --rate 0.3" + patiently() + on_domain(),
                           folder_ / "replay.log");
  ASSERT_TRUE(eventually([&] { return run("health --mapping" + on_domain()).exit_code == 0; }));
  const auto began = std::chrono::steady_clock::now();
  EXPECT_EQ(server.stop(), 0) << content("server.log");
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(10 * slowdown));
  const ProcessResult info = run("map-info --json " + path("server.stillmap"));
  ASSERT_EQ(info.exit_code, 0) << info.err;
  EXPECT_THAT(content("server.log"), HasSubstr("stopping"));
}

/// Where systemd would listen.
class NotifySocket {
 public:
  explicit NotifySocket(const std::string& file)
      : socket_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    file.copy(address.sun_path, sizeof address.sun_path - 1);
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    const timeval time{.tv_sec = patience.count(), .tv_usec = 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time);
  }
  ~NotifySocket() { close(socket_); }
  NotifySocket(const NotifySocket&) = delete;
  NotifySocket& operator=(const NotifySocket&) = delete;

  [[nodiscard]] std::string next() const {
    std::array<char, 256> text{};
    const ssize_t got = recv(socket_, text.data(), text.size(), 0);
    return got < 0 ? "nothing" : std::string(text.data(), static_cast<std::size_t>(got));
  }

 private:
  int socket_;
};

TEST_F(OperationTest, TellsSystemdThatItIsReadyAndThatItStops) {
  // A socket's name has room for 107 characters.
  const std::string name = "/tmp/stillmap_notify_" + std::to_string(getpid());
  const NotifySocket systemd(name);
  BackgroundProcess server("env NOTIFY_SOCKET=" + name + " " + server_command(),
                           folder_ / "server.log");
  EXPECT_EQ(systemd.next(), "READY=1") << content("server.log");
  EXPECT_EQ(server.stop(), 0);
  EXPECT_EQ(systemd.next(), "STOPPING=1");
  std::filesystem::remove(name);
}

}  // namespace
}  // namespace stillmap::test
