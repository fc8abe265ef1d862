// Throughput and latency of 2 MB scans from one process to others, and of region queries, on the
// networks that one machine can play. Prints tables of tests/network/README.md.
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "idl/dds/service_client.hpp"
#include "idl/interface/topics.hpp"
#include "tests/bench/dds_roles.hpp"
#include "tests/bench/dds_samples.hpp"

namespace stillmap::bench {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using sensor_msgs::msg::PointCloud2;
using stillmap_msgs::srv::GetStaticMap_Request;
using stillmap_msgs::srv::GetStaticMap_Response;

constexpr std::size_t scan_bytes = 2'000'000;
constexpr double run_s = 4.0;
constexpr std::uint32_t domain_id = 43;
constexpr auto bench_timeout = 60s;

/// This program in another role; its output is read, or its input is held open.
class Child {
 public:
  Child(const std::string& role, const std::string& network, const char* mode)
      : pipe_(::popen(
            ("exec /proc/" + std::to_string(::getpid()) + "/exe " + role + " '" + network + "'")
                .c_str(),
            mode)) {
    if (pipe_ == nullptr) throw std::runtime_error("cannot start " + role);
  }
  ~Child() { ::pclose(pipe_); }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  [[nodiscard]] std::vector<double> numbers() {
    std::vector<double> numbers;
    double number = 0.0;
    while (std::fscanf(pipe_, "%lf", &number) == 1) numbers.push_back(number);
    return numbers;
  }

 private:
  FILE* pipe_;
};

double cpu_s(int who) {
  rusage usage{};
  ::getrusage(who, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + static_cast<double>(time.tv_usec) / 1e6;
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double cpu_s() { return cpu_s(RUSAGE_SELF) + cpu_s(RUSAGE_CHILDREN); }

double share(std::vector<double>& sorted, double of_all) {
  if (sorted.empty()) return 0.0;
  const auto index = static_cast<std::size_t>(of_all * static_cast<double>(sorted.size() - 1));
  return sorted[index];
}

/// Publishes at the rate, as far as the writer keeps it; returns how many.
int publish(dds::Writer<PointCloud2>& writer, double rate_hz) {
  const auto began = Clock::now();
  const auto period = std::chrono::duration<double>(1.0 / rate_hz);
  int sent = 0;
  while (Clock::now() - began < std::chrono::duration<double>(run_s)) {
    if (writer.write(cloud_of(scan_bytes))) ++sent;
    std::this_thread::sleep_until(began + sent * period);
  }
  // Best-effort readers may miss it; they end by themselves then.
  for (int i = 0; i < 5; ++i) {
    std::this_thread::sleep_for(100ms);
    static_cast<void>(writer.write(last_cloud()));
  }
  return sent;
}

std::vector<double> latencies(std::vector<std::unique_ptr<Child>>& subscribers) {
  std::vector<double> all;
  for (const auto& subscriber : subscribers) {
    const std::vector<double> numbers = subscriber->numbers();
    all.insert(all.end(), numbers.begin(), numbers.end());
  }
  subscribers.clear();
  std::ranges::sort(all);
  return all;
}

bool wait_for_readers(const dds::MatchedReaders& readers, int count) {
  const auto deadline = Clock::now() + bench_timeout;
  while (readers.count() < count && Clock::now() < deadline) std::this_thread::sleep_for(20ms);
  return readers.count() >= count;
}

void run_scans(const Network& network, int rate_hz, int count) {
  dds::Participant participant(options_of(network, DdsRole::server, domain_id));
  const auto confirming = confirm_connections(participant);
  const auto topic = dds::points_topic("points", DeliveryMode::latest, 3);
  dds::Writer<PointCloud2> writer(participant, topic.dds_name, topic.writer);
  std::vector<std::unique_ptr<Child>> subscribers;
  for (int i = 0; i < count; ++i) {
    subscribers.push_back(std::make_unique<Child>("--subscribe", network.name, "r"));
  }
  if (!wait_for_readers(writer.readers(), count)) {
    std::printf("| %-9s | %2d Hz | %2d | subscribers did not all connect |\n", network.name.c_str(),
                rate_hz, count);
    return;
  }
  std::this_thread::sleep_for(500ms);
  const double cpu_before = cpu_s();
  const int sent = publish(writer, rate_hz);
  std::vector<double> ages_ms = latencies(subscribers);
  const double wanted = run_s * rate_hz;
  std::printf("| %-9s | %2d Hz | %2d | %3.0f %% | %5.1f %% | %6.1f | %6.1f | %4.0f %% |\n",
              network.name.c_str(), rate_hz, count, 100.0 * sent / wanted,
              100.0 * static_cast<double>(ages_ms.size()) / (sent * count), share(ages_ms, 0.5),
              share(ages_ms, 0.99), 100.0 * (cpu_s() - cpu_before) / run_s);
  std::fflush(stdout);
}

void run_queries(const Network& network, const char* name, std::uint32_t bytes, int count) {
  const Child server("--answer", network.name, "w");
  const auto participant = join(options_of(network, DdsRole::client, domain_id));
  dds::ServiceClient<GetStaticMap_Request, GetStaticMap_Response> client(*participant,
                                                                         "bench/get_static_map");
  GetStaticMap_Request request;
  request.max_bytes(bytes);
  std::vector<double> times_ms;
  // The first finds the server.
  static_cast<void>(client.call(request, bench_timeout));
  int answered = 0;
  for (int i = 0; i < count; ++i) {
    const auto began = Clock::now();
    if (client.call(request, bench_timeout)) ++answered;
    times_ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - began).count());
  }
  std::ranges::sort(times_ms);
  std::printf("| %-9s | %-5s | %d/%d | %7.2f | %7.2f |\n", network.name.c_str(), name, answered,
              count, share(times_ms, 0.5), share(times_ms, 0.99));
  std::fflush(stdout);
}

void run_all(const std::string& only) {
  std::printf("| network | scans | out | sent | delivered | p50 ms | p99 ms | CPU |\n");
  std::printf("|---|---|---|---|---|---|---|---|\n");
  for (const Network& network : networks()) {
    if (!network.name.starts_with(only)) continue;
    for (const int rate_hz : {10, 20, 50}) {
      for (const int count : {1, 5, 20}) run_scans(network, rate_hz, count);
    }
  }
  std::printf("\n| network | query | answered | p50 ms | p99 ms |\n|---|---|---|---|---|\n");
  for (const Network& network : networks()) {
    if (!network.name.starts_with(only)) continue;
    run_queries(network, "small", 0, 200);
    run_queries(network, "5 MB", 5'000'000, 15);
  }
}

const Network& network_named(const std::vector<Network>& all, const std::string& name) {
  const auto found = std::ranges::find(all, name, &Network::name);
  if (found == all.end()) throw std::invalid_argument("no network is called '" + name + "'");
  return *found;
}

void play(int argc, char** argv) {
  const std::string role = argc > 1 ? argv[1] : "";
  if (role != "--subscribe" && role != "--answer") return run_all(role);
  const std::vector<Network> all = networks();
  const Network& network = network_named(all, argc > 2 ? argv[2] : "");
  if (role == "--subscribe") return subscribe(options_of(network, DdsRole::client, domain_id));
  answer(options_of(network, DdsRole::server, domain_id));
}

}  // namespace
}  // namespace stillmap::bench

int main(int argc, char** argv) try {
  stillmap::bench::play(argc, argv);
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "dds_bench: %s\n", error.what());
  return 1;
}
