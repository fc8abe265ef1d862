#include "tests/bench/dds_roles.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <iostream>

#include "clients/library/tcp_rejoin_backoff.hpp"
#include "idl/dds/dds_error.hpp"
#include "idl/dds/reader.hpp"
#include "idl/dds/service_client.hpp"
#include "idl/interface/topics.hpp"
#include "sensor_msgs.h"
#include "tests/bench/dds_samples.hpp"

namespace stillmap::bench {

using namespace std::chrono_literals;
using stillmap_msgs::srv::GetStaticMap_Request;
using stillmap_msgs::srv::GetStaticMap_Response;
using stillmap_msgs::srv::GetStatus_Request;
using stillmap_msgs::srv::GetStatus_Response;

namespace {

constexpr const char* is_connected = "bench/is_connected";

}  // namespace

std::vector<Network> networks() {
  DdsNetworkConfig host;
  host.profile = "host";
  DdsNetworkConfig lan;
  lan.shared_memory = false;
  lan.interfaces = {"127.0.0.1"};
  DdsNetworkConfig wifi = lan;
  wifi.profile = "wifi";
  DdsNetworkConfig wan = lan;
  wan.profile = "wan";
  DdsNetworkConfig wan_client = wan;
  wan_client.peers = {"127.0.0.1"};
  return {{"host", host, host},
          {"lan, UDP", lan, lan},
          {"wifi, UDP", wifi, wifi},
          {"wan, TCP", wan, wan_client}};
}

dds::DdsOptions options_of(const Network& network, DdsRole role, std::uint32_t domain_id) {
  const bool server = role == DdsRole::server;
  dds::DdsOptions options = dds_options(server ? network.choice : network.client_choice, role);
  options.domain_id = domain_id;
  return options;
}

std::unique_ptr<IsConnectedService> confirm_connections(dds::Participant& participant) {
  return std::make_unique<IsConnectedService>(
      participant, is_connected, [](const GetStatus_Request&) { return GetStatus_Response(); });
}

std::unique_ptr<dds::Participant> join(const dds::DdsOptions& options) {
  TcpRejoinBackoff backoff(options, 60s);
  while (true) {
    auto participant = std::make_unique<dds::Participant>(options);
    if (options.transport != dds::NetworkTransport::tcp) return participant;
    dds::ServiceClient<GetStatus_Request, GetStatus_Response> client(*participant, is_connected);
    do {
      if (client.call(GetStatus_Request(), backoff.next_wait())) return participant;
      if (backoff.timed_out()) throw dds::DdsError("nobody was found over TCP within 60 s");
    } while (!backoff.rejoin_due());
  }
}

void subscribe(const dds::DdsOptions& options) {
  // Over TCP, Fast DDS 2.9 may neither connect nor end; the run goes on without this subscriber.
  constexpr unsigned int longest_life_s = 90;
  ::alarm(longest_life_s);
  const std::unique_ptr<dds::Participant> joined = join(options);
  dds::Participant& participant = *joined;
  const auto topic = dds::points_topic("points", DeliveryMode::latest, 3);
  dds::Reader<sensor_msgs::msg::PointCloud2> reader(participant, topic.dds_name, topic.reader);
  sensor_msgs::msg::PointCloud2 cloud;
  std::vector<double> latencies_ms;
  auto backoff = 60s;
  while (reader.take(cloud, {}, backoff)) {
    if (is_last(cloud)) break;
    latencies_ms.push_back(age_ms(cloud));
    backoff = 3s;
  }
  for (const double latency : latencies_ms) std::printf("%f\n", latency);
}

void answer(const dds::DdsOptions& options) {
  dds::Participant participant(options);
  const auto confirming = confirm_connections(participant);
  const dds::ServiceServer<GetStaticMap_Request, GetStaticMap_Response> server(
      participant, "bench/get_static_map",
      [](const GetStaticMap_Request& request) { return map_of(request.max_bytes()); });
  std::string line;
  while (std::getline(std::cin, line)) {
  }
}

}  // namespace stillmap::bench
