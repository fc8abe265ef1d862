#include <algorithm>

#include "clients/doctor/checks.hpp"

namespace stillmap::cli {
namespace {

constexpr const char* cloud_type = "sensor_msgs::msg::dds_::PointCloud2_";

struct Publisher {
  const dds::RemoteParticipant* participant;
  const dds::Endpoint* endpoint;
};

std::vector<Publisher> publishers(const std::vector<dds::RemoteParticipant>& participants,
                                  const std::string& topic) {
  std::vector<Publisher> found;
  for (const dds::RemoteParticipant& participant : participants) {
    for (const dds::Endpoint& endpoint : participant.endpoints) {
      if (endpoint.is_writer && endpoint.topic == topic) found.push_back({&participant, &endpoint});
    }
  }
  return found;
}

// ROS names of other topics with clouds, without the server's own output.
std::string other_clouds(const SystemSnapshot& snapshot, const std::string& points) {
  std::string names;
  for (const dds::RemoteParticipant& participant : snapshot.participants) {
    for (const dds::Endpoint& endpoint : participant.endpoints) {
      const bool is_ours = endpoint.topic.starts_with("rt/" + snapshot.server_name + "/");
      if (!endpoint.is_writer || endpoint.type != cloud_type || is_ours) continue;
      if (endpoint.topic == points || !endpoint.topic.starts_with("rt/")) continue;
      names.append(names.empty() ? "" : ", ").append(endpoint.topic.substr(3));
    }
  }
  return names;
}

std::string domain_that_publishes(const SystemSnapshot& snapshot, const std::string& points) {
  for (const OtherDomain& domain : snapshot.other_domains) {
    if (!publishers(domain.participants, points).empty()) return std::to_string(domain.id);
  }
  return {};
}

dds::Diagnostic no_publisher_diagnostic(const SystemSnapshot& snapshot, const std::string& points) {
  dds::Diagnostic diagnostic{
      .severity = dds::Severity::problem,
      .what = "no scans: nobody publishes " + points,
      .evidence = "participants in domain " + std::to_string(snapshot.dds.domain_id) + ": " +
                  std::to_string(snapshot.participants.size()) + ", and none of them does",
      .hint = "start the lidar's driver, or 'stillmap replay DATASET'"};
  if (const std::string names = other_clouds(snapshot, points); !names.empty()) {
    diagnostic.evidence = "sensor_msgs/PointCloud2 is published on " + names;
    diagnostic.hint = "did you mean that topic? Set topics.points, or remap the driver";
  } else if (const std::string domain = domain_that_publishes(snapshot, points); !domain.empty()) {
    diagnostic.evidence = "in domain " + domain + " somebody publishes it";
    diagnostic.hint = "bring server and sensor into one domain: dds.domain_id, ROS_DOMAIN_ID";
  }
  return diagnostic;
}

// There are publishers, and not one scan came.
dds::Diagnostic no_scans_diagnostic(const std::vector<Publisher>& found, const std::string& points,
                                    const std::string& server_says) {
  const Publisher& first = found.front();
  return {.severity = dds::Severity::problem,
          .what = "no scans, though " + points + " is published",
          .evidence = "by " + describe(*first.participant) + ", " + describe(first.endpoint->qos) +
                      "; the server says: " + server_says,
          .hint =
              "see the diagnostics about these two, if there are any; else the publisher has "
              "nothing to send, or large messages get lost on the way (UDP buffers)"};
}

void add_rejected_clouds(const dds::ServerStatus& status, Diagnostics& diagnostics) {
  const std::uint64_t received = status.counter("scans_received");
  for (const dds::NamedCounter& counter : status.counters) {
    if (!counter.name.starts_with("dropped_bad_cloud_")) continue;
    diagnostics.push_back(
        {.severity = counter.value == received ? dds::Severity::problem : dds::Severity::advice,
         .what =
             "clouds are refused: " + counter.name.substr(std::string("dropped_bad_cloud_").size()),
         .evidence = std::to_string(counter.value) + " of " + std::to_string(received) + " scans" +
                     (status.reason.empty() ? "" : "; " + status.reason),
         .hint = "give the server the names of the cloud's fields (input.fields) "
                 "and the sensor that sends it (sensor: " +
                 status.sensor + " now)"});
  }
}

}  // namespace

Diagnostics check_scans(const SystemSnapshot& snapshot) {
  const DiscoveredServer* const server = answering_server(snapshot);
  if (server == nullptr) return {};
  const dds::ServerStatus& status = *server->status;
  Diagnostics diagnostics;
  const std::string points = points_topic_of(snapshot);
  const auto found = publishers(snapshot.participants, points);
  if (found.empty() && status.received_hz == 0.0) {
    diagnostics.push_back(no_publisher_diagnostic(snapshot, points));
  } else if (status.counter("scans_received") == 0) {
    diagnostics.push_back(no_scans_diagnostic(found, points, status.reason));
  }
  add_rejected_clouds(status, diagnostics);
  const std::uint64_t mapped = status.counter("scans_mapped");
  if (diagnostics.empty() && mapped == 0 && status.counter("scans_received") > 0) {
    diagnostics.push_back(
        {.severity = dds::Severity::problem,
         .what = "scans arrive and none is mapped",
         .evidence = status.reason,
         .hint = "compare the server's sensor (" + status.sensor + ") with the one that sends"});
  }
  return diagnostics;
}

Diagnostics check_frames(const SystemSnapshot& snapshot) {
  const DiscoveredServer* const server = answering_server(snapshot);
  if (server == nullptr || server->status->counter("scans_received") == 0) return {};
  const std::string& frame = server->status->scan_frame;
  if (frame.empty()) {
    return {{.severity = dds::Severity::advice,
             .what = "the clouds name no frame",
             .evidence = "header.frame_id of the last cloud is empty",
             .hint = "set the driver's frame_id, so that tf can place the clouds"}};
  }
  if (snapshot.frames.empty() || snapshot.frames.contains(frame)) return {};
  std::string known;
  for (const std::string& one : snapshot.frames) {
    known.append(known.empty() ? "" : ", ").append(one);
  }
  return {{.severity = dds::Severity::advice,
           .what = "tf does not know the clouds' frame '" + frame + "'",
           .evidence = "tf has " + known,
           .hint = "set frames.lidar: '' (the server takes the cloud's frame) or to '" + frame +
                   "', or publish the transform of the sensor's mount on tf_static"}};
}

}  // namespace stillmap::cli
