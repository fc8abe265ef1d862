#include <algorithm>

#include "clients/doctor/checks.hpp"

namespace stillmap {
namespace {

constexpr const char* cloud_type = "sensor_msgs::msg::dds_::PointCloud2_";

struct Publisher {
  const Peer* peer;
  const Endpoint* endpoint;
};

std::vector<Publisher> publishers(const std::vector<Peer>& peers, const std::string& topic) {
  std::vector<Publisher> found;
  for (const Peer& peer : peers) {
    for (const Endpoint& endpoint : peer.endpoints) {
      if (endpoint.is_writer && endpoint.topic == topic) found.push_back({&peer, &endpoint});
    }
  }
  return found;
}

// Clouds under other names, as a ROS user writes them; a server's own clouds are no input.
std::string other_clouds(const Evidence& evidence, const std::string& points) {
  std::string names;
  for (const Peer& peer : evidence.peers) {
    for (const Endpoint& endpoint : peer.endpoints) {
      const bool is_ours = endpoint.topic.starts_with("rt/" + evidence.server_name + "/");
      if (!endpoint.is_writer || endpoint.type != cloud_type || is_ours) continue;
      if (endpoint.topic == points || !endpoint.topic.starts_with("rt/")) continue;
      names.append(names.empty() ? "" : ", ").append(endpoint.topic.substr(3));
    }
  }
  return names;
}

std::string elsewhere(const Evidence& evidence, const std::string& points) {
  for (const OtherDomain& domain : evidence.other_domains) {
    if (!publishers(domain.peers, points).empty()) return std::to_string(domain.id);
  }
  return {};
}

Finding nobody_publishes(const Evidence& evidence, const std::string& points) {
  Finding finding{.severity = Severity::problem,
                  .what = "no scans: nobody publishes " + points,
                  .evidence = "peers in domain " + std::to_string(evidence.dds.domain_id) + ": " +
                              std::to_string(evidence.peers.size()) + ", and none of them does",
                  .way_out = "start the lidar's driver, or 'stillmap replay DATASET'"};
  if (const std::string names = other_clouds(evidence, points); !names.empty()) {
    finding.evidence = "sensor_msgs/PointCloud2 is published on " + names;
    finding.way_out = "did you mean that topic? Set topics.points, or remap the driver";
  } else if (const std::string domain = elsewhere(evidence, points); !domain.empty()) {
    finding.evidence = "in domain " + domain + " somebody publishes it";
    finding.way_out = "bring server and sensor into one domain: dds.domain_id, ROS_DOMAIN_ID";
  }
  return finding;
}

// There are publishers, and not one scan came.
Finding nothing_arrives(const std::vector<Publisher>& found, const std::string& points,
                        const std::string& server_says) {
  const Publisher& first = found.front();
  return {.severity = Severity::problem,
          .what = "no scans, though " + points + " is published",
          .evidence = "by " + describe(*first.peer) + ", " + describe(first.endpoint->qos) +
                      "; the server says: " + server_says,
          .way_out =
              "see the findings about these two, if there are any; else the publisher has "
              "nothing to send, or large messages get lost on the way (UDP buffers)"};
}

void add_drops(const ServerStatus& status, Findings& findings) {
  const std::uint64_t received = status.counter("scans_received");
  for (const NamedCounter& counter : status.counters) {
    if (!counter.name.starts_with("dropped_bad_cloud_")) continue;
    findings.push_back(
        {.severity = counter.value == received ? Severity::problem : Severity::advice,
         .what =
             "clouds are refused: " + counter.name.substr(std::string("dropped_bad_cloud_").size()),
         .evidence = std::to_string(counter.value) + " of " + std::to_string(received) + " scans" +
                     (status.reason.empty() ? "" : "; " + status.reason),
         .way_out = "give the server the names of the cloud's fields (input.fields) "
                    "and the sensor that sends it (sensor: " +
                    status.sensor + " now)"});
  }
}

}  // namespace

Findings check_scans(const Evidence& evidence) {
  const ServerSeen* const server = answering_server(evidence);
  if (server == nullptr) return {};
  const ServerStatus& status = *server->status;
  Findings findings;
  const std::string points = points_topic_of(evidence);
  const auto found = publishers(evidence.peers, points);
  if (found.empty() && status.received_hz == 0.0) {
    findings.push_back(nobody_publishes(evidence, points));
  } else if (status.counter("scans_received") == 0) {
    findings.push_back(nothing_arrives(found, points, status.reason));
  }
  add_drops(status, findings);
  const std::uint64_t mapped = status.counter("scans_mapped");
  if (findings.empty() && mapped == 0 && status.counter("scans_received") > 0) {
    findings.push_back(
        {.severity = Severity::problem,
         .what = "scans arrive and none is mapped",
         .evidence = status.reason,
         .way_out = "compare the server's sensor (" + status.sensor + ") with the one that sends"});
  }
  return findings;
}

Findings check_frames(const Evidence& evidence) {
  const ServerSeen* const server = answering_server(evidence);
  if (server == nullptr || server->status->counter("scans_received") == 0) return {};
  const std::string& frame = server->status->scan_frame;
  if (frame.empty()) {
    return {{.severity = Severity::advice,
             .what = "the clouds name no frame",
             .evidence = "header.frame_id of the last cloud is empty",
             .way_out = "set the driver's frame_id, so that tf can place the clouds"}};
  }
  if (evidence.frames.empty() || evidence.frames.contains(frame)) return {};
  std::string known;
  for (const std::string& one : evidence.frames) {
    known.append(known.empty() ? "" : ", ").append(one);
  }
  return {{.severity = Severity::advice,
           .what = "tf does not know the clouds' frame '" + frame + "'",
           .evidence = "tf has " + known,
           .way_out = "set frames.lidar: '' (the server takes the cloud's frame) or to '" + frame +
                      "', or publish the transform of the sensor's mount on tf_static"}};
}

}  // namespace stillmap
