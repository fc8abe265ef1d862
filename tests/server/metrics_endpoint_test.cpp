#include "server/monitoring/metrics_endpoint.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <list>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/monitoring/metrics.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::StartsWith;

/// A TCP connection to the endpoint.
class Connection {
 public:
  explicit Connection(const std::string& address)
      : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const auto colon = address.rfind(':');
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = ::inet_addr(address.substr(0, colon).c_str());
    to.sin_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(colon + 1))));
    is_open_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  }
  ~Connection() { ::close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  [[nodiscard]] bool is_open() const { return is_open_; }

  /// False when the other side has gone.
  bool send(const std::string& text) const {
    return ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL) ==
           static_cast<ssize_t>(text.size());
  }

  /// Everything until the other side closes, or nothing comes for so long.
  [[nodiscard]] std::string receive(std::chrono::seconds timeout) const {
    const timeval time{.tv_sec = timeout.count(), .tv_usec = 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &time, sizeof time);
    std::string all;
    std::array<char, 4096> part{};
    ssize_t bytes = 0;
    while ((bytes = ::recv(socket_, part.data(), part.size(), 0)) > 0) {
      all.append(part.data(), static_cast<std::size_t>(bytes));
    }
    return all;
  }

  /// Whether the other side closes it, instead of sending nothing for so long.
  [[nodiscard]] bool is_closed_within(std::chrono::seconds timeout) const {
    errno = 0;
    static_cast<void>(receive(timeout));
    return errno != EAGAIN;
  }

 private:
  int socket_;
  bool is_open_ = false;
};

constexpr auto scrape_timeout = 10s * test::slowdown;

class MetricsEndpointTest : public testing::Test {
 protected:
  /// As Prometheus asks; it gives up after 10 s, as does this, but for sanitizers.
  void expect_scrape_is_answered() {
    const auto began = std::chrono::steady_clock::now();
    const Connection scrape(endpoint_.address());
    ASSERT_TRUE(scrape.is_open());
    scrape.send("GET /metrics HTTP/1.1\r\nHost: robot\r\n\r\n");
    const std::string answer = scrape.receive(scrape_timeout);
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 200"));
    EXPECT_THAT(answer, HasSubstr("stillmap_uptime_seconds"));
    EXPECT_LT(std::chrono::steady_clock::now() - began, scrape_timeout);
  }

  Metrics metrics_;
  MetricsEndpoint endpoint_{"127.0.0.1:0", metrics_, [] { return dds::ServerStatus(); }};
};

TEST_F(MetricsEndpointTest, AnswersBesideConnectionsThatNeverAsk) {
  std::list<Connection> silent;
  for (int i = 0; i < 40; ++i) silent.emplace_back(endpoint_.address());
  std::list<Connection> half_open;
  for (int i = 0; i < 40; ++i) {
    half_open.emplace_back(endpoint_.address()).send("GET /metrics HTTP/1.1\r\nHost: ");
  }
  expect_scrape_is_answered();
  // The first were closed for taking too long.
  EXPECT_TRUE(silent.front().is_closed_within(scrape_timeout));
  expect_scrape_is_answered();
}

TEST_F(MetricsEndpointTest, AnswersBesideConnectionsThatDrip) {
  std::list<Connection> slow;
  for (int i = 0; i < 40; ++i) slow.emplace_back(endpoint_.address()).send("GET /metrics HTTP/1.1");
  std::jthread drip([&slow](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      for (const Connection& one : slow) one.send("\r\nX: y");
      std::this_thread::sleep_for(100ms);
    }
  });
  expect_scrape_is_answered();
}

TEST_F(MetricsEndpointTest, SaysWhereTheMetricsAre) {
  for (const auto& [request, answer] : std::vector<std::pair<std::string, std::string>>{
           {"GET /elsewhere HTTP/1.1\r\nHost: robot\r\n\r\n", "HTTP/1.1 404"},
           {"DELETE /metrics HTTP/1.1\r\nHost: robot\r\n\r\n", "HTTP/1.1 405"},
           {"GET /metrics?all=1 HTTP/1.0\r\n\r\n", "HTTP/1.1 200"}}) {
    const Connection client(endpoint_.address());
    client.send(request);
    EXPECT_THAT(client.receive(scrape_timeout), StartsWith(answer)) << request;
  }
  const Connection stranger(endpoint_.address());
  stranger.send("no request at all\r\n\r\n");
  EXPECT_TRUE(stranger.is_closed_within(scrape_timeout));
}

TEST_F(MetricsEndpointTest, AcceptsFurtherConnectionsWhereTooManyWereOpen) {
  std::list<Connection> silent;
  for (int i = 0; i < 300; ++i) silent.emplace_back(endpoint_.address());
  expect_scrape_is_answered();
}

TEST_F(MetricsEndpointTest, ClosesConnectionsWhoseHeaderIsTooLong) {
  const Connection greedy(endpoint_.address());
  greedy.send("GET /metrics HTTP/1.1\r\nX: ");
  greedy.send(std::string(100'000, 'x'));
  EXPECT_TRUE(greedy.is_closed_within(scrape_timeout));
  expect_scrape_is_answered();
}

TEST_F(MetricsEndpointTest, AnswersBesideClientsThatDoNotRead) {
  std::list<Connection> deaf;
  for (int i = 0; i < 40; ++i) {
    const Connection& one = deaf.emplace_back(endpoint_.address());
    for (int k = 0; k < 3; ++k) one.send("GET /metrics HTTP/1.1\r\nHost: robot\r\n\r\n");
  }
  expect_scrape_is_answered();
}

}  // namespace
}  // namespace stillmap::server
