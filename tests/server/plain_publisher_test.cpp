// A lidar driver with Fast DDS's defaults, in a process of its own, against the server with its
// own.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

#include "tests/clients/process.hpp"
#include "tests/server/server_process.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

// 2.4 MB, as an HDL-64E sends them.
constexpr int large = 150'000;
// Six fragments.
constexpr int small = 20'000;

class PlainPublisher : public testing::Test {
 protected:
  ~PlainPublisher() override {
    if (publisher_) publisher_->stop();
  }

  /// Publishes, and returns the number of scans that were sent.
  std::uint64_t publish(int points, double rate_hz, int scans, const std::string& qos) {
    const std::string words = std::to_string(domain_) + " " + std::to_string(points) + " " +
                              std::to_string(rate_hz) + " " + std::to_string(scans) + " " + qos;
    const std::filesystem::path log = folder_ / "publisher.txt";
    publisher_.emplace(std::string(PLAIN_PUBLISHER) + " " + words, log);
    std::uint64_t sent = 0;
    EXPECT_TRUE(eventually([&] { return bool(std::ifstream(log) >> sent); }));
    return sent;
  }

  [[nodiscard]] ClientOptions client_options() const {
    dds::DdsOptions dds;
    dds.domain_id = static_cast<std::uint32_t>(domain_);
    return {.dds = dds, .server_name = "stillmap", .request_timeout = patience};
  }
  [[nodiscard]] std::string options() const { return "--domain " + std::to_string(domain_); }

  ScratchFolder folder_;
  int domain_ = free_domain();
  std::filesystem::path config_ =
      folder_.file("server.yaml", "sensor: hdl_64e\ndds: {domain_id: " + std::to_string(domain_) +
                                      "}\nmap: {file: map.stillmap}\nlabels: {source: none}\n");
  ServerProcess server_{{"--config", config_.string()}};
  Client client_{client_options()};
  std::optional<BackgroundProcess> publisher_;
};

TEST_F(PlainPublisher, LargeScansOfAReliableOneArrive) {
  client_.wait_for_server(patience);
  const std::uint64_t sent = publish(large, 10.0 / slowdown, 40, "5 reliable");
  EXPECT_EQ(sent, 40U);
  const auto received = [&] { return client_.status().counter("scans_received"); };
  EXPECT_TRUE(
      eventually([&] { return received() + client_.status().counter("scans_lost") == sent; }));
  // All of them, unless this machine has no time for the server.
  EXPECT_GT(received(), sent * 4 / 5);
}

TEST_F(PlainPublisher, WhatABestEffortOneLosesIsCountedAndExplained) {
  client_.wait_for_server(patience);
  const std::uint64_t sent = publish(small, 20.0, 100, "5 best_effort 8");
  dds::ServerStatus status;
  EXPECT_TRUE(eventually([&] {
    status = client_.status();
    return status.counter("scans_received") + status.counter("scans_lost") > sent - sent / 5;
  }));
  EXPECT_GT(status.counter("scans_received"), sent / 5);
  EXPECT_GT(status.counter("scans_lost"), sent / 10);
  // What was lost before the first that arrived, and after the last, nobody knows.
  EXPECT_LE(status.counter("scans_received") + status.counter("scans_lost"), sent);
  const auto health = run_stillmap("health " + options(), folder_.path());
  EXPECT_THAT(health.out, HasSubstr("scans of plain_publisher get lost on the way"));
  const auto doctor = run_stillmap("doctor " + options(), folder_.path());
  EXPECT_THAT(doctor.out, HasSubstr("let the publisher offer reliable delivery"));
}

}  // namespace
}  // namespace stillmap::test
