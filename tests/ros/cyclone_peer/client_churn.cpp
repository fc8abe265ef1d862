#include <algorithm>
#include <vector>

#include "tests/ros/cyclone_peer/commands.hpp"
#include "tests/ros/cyclone_peer/report.hpp"
#include "tests/ros/cyclone_peer/rmw_client.hpp"

namespace stillmap::peer {

using namespace std::chrono_literals;

int churn_clients(const ServerAddress& address, int clients) {
  using Request = stillmap_msgs_srv_dds__GetStatus_Request_;
  using Reply = stillmap_msgs_srv_dds__GetStatus_Response_;
  Request request{};
  request.format_version = 4;
  std::vector<double> times_ms;
  for (int i = 0; i < clients; ++i) {
    const Participant participant(address.domain_id);
    RmwClient<Request, Reply> client(participant, address.server + "/get_status");
    if (!client.wait_for_server(30s)) throw std::runtime_error("no server found");
    const auto began = std::chrono::steady_clock::now();
    if (!client.call(
            request, [](const Reply&) {}, 5s))
      continue;
    const auto took = std::chrono::steady_clock::now() - began;
    times_ms.push_back(std::chrono::duration<double, std::milli>(took).count());
  }
  std::ranges::sort(times_ms);
  const bool is_answered = !times_ms.empty();
  Line("new clients, one request each")
      .add("clients", clients)
      .add("answered", times_ms.size())
      .add("median_ms", is_answered ? times_ms[times_ms.size() / 2] : 0.0)
      .add("longest_ms", is_answered ? times_ms.back() : 0.0);
  return times_ms.size() == static_cast<std::size_t>(clients) ? 0 : 1;
}

}  // namespace stillmap::peer
