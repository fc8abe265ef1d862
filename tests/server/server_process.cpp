#include "tests/server/server_process.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <fstream>
#include <stdexcept>

#include "tests/idl/dds_fixture.hpp"
#include "tests/server/room_scans.hpp"

extern char** environ;

namespace stillmap::test {

ServerProcess::ServerProcess(const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {STILLMAP_SERVER};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  if (posix_spawn(&pid_, STILLMAP_SERVER, nullptr, nullptr, argv.data(), environ) != 0) {
    throw std::runtime_error(std::string("cannot start ") + STILLMAP_SERVER);
  }
}

ServerProcess::~ServerProcess() {
  if (pid_ == 0) return;
  send(SIGKILL);
  waitpid(pid_, nullptr, 0);
}

void ServerProcess::send(int signal) const { kill(pid_, signal); }

int ServerProcess::wait_for_exit(std::chrono::seconds timeout) {
  int status = 0;
  if (!eventually([&] { return waitpid(pid_, &status, WNOHANG) != 0; }, timeout)) return -2;
  pid_ = 0;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

ServiceSetup::ServiceSetup(const std::string& delivery, const std::string& map_options,
                           const std::string& sensors) {
  std::ofstream(folder_ / "server.yaml")
      << sensors << "\n"
      << "dds: {domain_id: " << dds::test_domain_id() << ", interfaces: [127.0.0.1]}\n"
      << "input: {delivery: " << delivery << ", queue_length: 3}\n"
      << "publish: {path_period_s: 0.1, cloud_period_s: 0.1, tiles_period_s: 0.1, "
      << "status_period_s: 0.2}\n"
      << "map: {file: map.stillmap, " << map_options << "}\n";
}

void ServiceSetup::add(const std::string& yaml) const {
  std::ofstream(folder_ / "server.yaml", std::ios::app) << yaml;
}

std::vector<std::string> ServiceSetup::server_arguments() const {
  // Also where ROS_DOMAIN_ID is set, which comes before the file.
  return {"--config", (folder_ / "server.yaml").string(), "--domain",
          std::to_string(dds::test_domain_id())};
}

dds::DdsOptions ServiceSetup::dds() const { return dds::loopback(true); }

ClientOptions ServiceSetup::client() const {
  return {.dds = dds(), .server_name = "stillmap", .request_timeout = patience};
}

ScanPublisherOptions ServiceSetup::publisher(bool lossless) const {
  return {.dds = dds(), .lossless = lossless};
}

void drive(ScanPublisher& publisher, int first, int last) {
  ASSERT_TRUE(publisher.wait_for_subscriber(patience));
  for (int i = first; i < last; ++i) {
    ASSERT_TRUE(publisher.publish(room_scan(i), {}, patience)) << "scan " << i;
  }
}

bool wait_for_scans(Client& client, std::uint64_t scans) {
  return eventually([&] {
    const dds::ServerStatus status = client.status();
    return status.counter("scans_mapped") + status.dropped() >= scans;
  });
}

}  // namespace stillmap::test
