#include <algorithm>
#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "tests/ros/cyclone_peer/commands.hpp"
#include "tests/ros/cyclone_peer/report.hpp"
#include "tests/ros/cyclone_peer/rmw_client.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::peer {

using namespace std::chrono_literals;

namespace {

/// How many of so many new clients, each of a participant of its own, are answered when they ask
/// `service` this once; prints how fast.
template <typename Reply, typename Request>
int ask_once_each(const ServerAddress& address, const std::string& service, const Request& request,
                  int clients, std::chrono::milliseconds pause,
                  const std::function<std::size_t(const Reply&)>& bytes_of) {
  std::vector<double> times_ms;
  std::size_t largest_bytes = 0;
  for (int i = 0; i < clients; ++i) {
    std::this_thread::sleep_for(pause);
    const Participant participant(address.domain_id);
    RmwClient<Request, Reply> client(participant, address.server + "/" + service);
    if (!client.wait_for_server(30s * test::slowdown)) throw std::runtime_error("no server found");
    const auto began = std::chrono::steady_clock::now();
    const auto handle = [&](const Reply& reply) {
      largest_bytes = std::max(largest_bytes, bytes_of(reply));
    };
    if (!client.call(request, handle, 5s * test::slowdown)) continue;
    const auto took = std::chrono::steady_clock::now() - began;
    times_ms.push_back(std::chrono::duration<double, std::milli>(took).count());
  }
  std::ranges::sort(times_ms);
  const bool is_answered = !times_ms.empty();
  Line("new clients, one request each")
      .add("service", service)
      .add("clients", clients)
      .add("answered", times_ms.size())
      .add("largest_bytes", largest_bytes)
      .add("median_ms", is_answered ? times_ms[times_ms.size() / 2] : 0.0)
      .add("longest_ms", is_answered ? times_ms.back() : 0.0);
  return times_ms.size() == static_cast<std::size_t>(clients) ? 0 : 1;
}

}  // namespace

int churn_clients(const ServerAddress& address, int clients) {
  using Reply = stillmap_msgs_srv_dds__GetStatus_Response_;
  stillmap_msgs_srv_dds__GetStatus_Request_ request{};
  request.format_version = 8;
  return ask_once_each<Reply>(address, "get_status", request, clients, 0ms,
                              [](const Reply&) { return std::size_t{0}; });
}

int churn_clients_of_large_replies(const ServerAddress& address, int clients) {
  using Reply = octomap_msgs_srv_dds__GetOctomap_Response_;
  const octomap_msgs_srv_dds__GetOctomap_Request_ request{};
  // Meanwhile the server falls silent: everything it wrote is acknowledged.
  constexpr auto pause = 500ms;
  return ask_once_each<Reply>(
      address, "octomap_full", request, clients, pause,
      [](const Reply& reply) { return std::size_t{reply.map.data._length}; });
}

}  // namespace stillmap::peer
