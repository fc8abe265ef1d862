#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "clients/doctor/checks.hpp"

namespace stillmap::cli {
namespace {

/// The server of the name asked for that answered; nothing when none did.
const DiscoveredServer* answering_server(const SystemSnapshot& snapshot) {
  const auto found = std::ranges::find_if(snapshot.servers, [&](const DiscoveredServer& server) {
    return server.status && server.name_space == snapshot.server_name;
  });
  return found == snapshot.servers.end() ? nullptr : &*found;
}

/// The sensor's topic as DDS names it: the name that the server reports, else the configured one.
std::string points_topic_of(const SystemSnapshot& snapshot) {
  const DiscoveredServer* const server = answering_server(snapshot);
  const bool tells = server != nullptr && !server->status->points_topic.empty();
  return "rt/" + (tells ? server->status->points_topic : snapshot.points_topic);
}

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

constexpr const char* encoding_hint =
    "let the publisher write classic CDR (XCDR1), as ROS 2 does, of the message as ROS 2 defines "
    "it";

/// Messages beside the clouds.
void add_unreadable_messages(const dds::ServerStatus& status, Diagnostics& diagnostics) {
  for (const char* const input : {"tf_static", "imu", "gnss", "odometry_prior", "initial_pose"}) {
    const std::uint64_t count = status.counter(std::string(input) + "_unreadable");
    if (count == 0) continue;
    diagnostics.push_back({.severity = dds::Severity::advice,
                           .what = "the server cannot read messages of " + std::string(input),
                           .evidence = std::to_string(count) +
                                       " messages; its log says what they have and who wrote them",
                           .hint = encoding_hint});
  }
}

void add_rejected_clouds(const dds::ServerStatus& status, Diagnostics& diagnostics) {
  const std::uint64_t received = status.counter("scans_received");
  for (const dds::NamedCounter& counter : status.counters) {
    if (counter.name != dds::bad_clouds_counter) continue;
    const bool is_unreadable = counter.detail == dds::unreadable_cloud;
    diagnostics.push_back(
        {.severity = counter.value == received ? dds::Severity::problem : dds::Severity::advice,
         .what = "clouds are refused: " + counter.detail,
         .evidence = std::to_string(counter.value) + " of " + std::to_string(received) + " scans" +
                     (status.reason.empty() ? "" : "; " + status.reason),
         .hint = is_unreadable ? encoding_hint
                               : "give the server the names of the cloud's fields (input.fields) "
                                 "and the sensor that sends it (sensor: " +
                                     status.sensor + " now)"});
  }
}

// Larger offsets break tf lookups.
constexpr double max_clock_offset_s = 0.1;
// Older scans are taken to be replayed.
constexpr double replayed_age_s = 3600.0;

std::string seconds(double value) {
  std::array<char, 32> text{};
  const int length = std::snprintf(text.data(), text.size(), "%.2f s", value);
  return {text.data(), static_cast<std::size_t>(length)};
}

void compare_with_server(const DiscoveredServer& server, Diagnostics& diagnostics) {
  const double difference_s = 1e-9 * static_cast<double>(server.status->stamp_ns - server.asked_ns);
  const double uncertainty_s = 0.5e-9 * static_cast<double>(server.round_trip_ns);
  if (std::abs(difference_s) <= max_clock_offset_s + uncertainty_s) return;
  diagnostics.push_back({.severity = dds::Severity::problem,
                         .what = "this machine's clock and the server's differ",
                         .evidence = "the server's is " + seconds(std::abs(difference_s)) +
                                     (difference_s > 0 ? " ahead" : " behind") + ", +- " +
                                     seconds(uncertainty_s),
                         .hint = "keep both by NTP or PTP (timedatectl set-ntp true; chrony)"});
}

/// "1 h 0 min" of a delay that is hours as clocks of other time zones differ; empty of others.
std::string hours_behind(double delay_s) {
  constexpr double most_hours = 14.0;
  constexpr double tolerance_s = 120.0;
  const double hours = std::round(delay_s / 3600.0);
  const bool is_near = std::abs(delay_s - 3600.0 * hours) <= tolerance_s;
  if (!(hours >= 1.0 && hours <= most_hours && is_near)) return {};
  const int minutes = static_cast<int>(std::round(delay_s / 60.0));
  return std::to_string(minutes / 60) + " h " + std::to_string(minutes % 60) + " min";
}

void compare_with_sensor(const dds::ServerStatus& status, Diagnostics& diagnostics) {
  const double delay_s = status.scan_delay_s;
  if (status.counter("scans_received") == 0) return;
  if (const std::string hours = hours_behind(delay_s); !hours.empty()) {
    diagnostics.push_back(
        {.severity = dds::Severity::advice,
         .what = "the scans' stamps are about " + hours + " behind: a time zone or a replay?",
         .evidence = "the last scan's stamp is " + seconds(delay_s) + " behind the server's clock",
         .hint = "let the sensor's clock and this machine's have UTC (PTP, NTP), not local time; a "
                 "replayed bag has old stamps"});
    return;
  }
  if (delay_s > replayed_age_s) return;
  if (delay_s >= -max_clock_offset_s && delay_s <= 1.0) return;
  diagnostics.push_back(
      {.severity = dds::Severity::advice,
       .what = delay_s < 0 ? "scans come from the future" : "scans come late",
       .evidence = "the last scan's stamp is " + seconds(std::abs(delay_s)) +
                   (delay_s < 0 ? " ahead of" : " behind") + " the server's clock",
       .hint = "keep the sensor's clock and the server's by PTP or NTP, and let the driver take "
               "the sensor's time; a replayed bag has old stamps"});
}

bool is_same(const dds::Diagnostic& a, const dds::Diagnostic& b) { return a.what == b.what; }

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
  add_unreadable_messages(status, diagnostics);
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

Diagnostics check_clocks(const SystemSnapshot& snapshot) {
  Diagnostics diagnostics;
  const DiscoveredServer* const server = answering_server(snapshot);
  if (server == nullptr) return diagnostics;
  compare_with_server(*server, diagnostics);
  compare_with_sensor(*server->status, diagnostics);
  return diagnostics;
}

Diagnostics check_server_diagnostics(const SystemSnapshot& snapshot) {
  const DiscoveredServer* const server = answering_server(snapshot);
  return server == nullptr ? Diagnostics() : server->status->diagnostics;
}

Diagnostics diagnose(const SystemSnapshot& snapshot) {
  constexpr std::array checks{check_shared_memory, check_socket_buffers, check_multicast,
                              check_domain,        check_security,       check_silent_participants,
                              check_servers,       check_endpoints,      check_scans,
                              check_frames,        check_clocks,         check_server_diagnostics};
  Diagnostics all;
  for (const auto check : checks) {
    for (dds::Diagnostic& diagnostic : check(snapshot)) {
      const bool is_known = std::ranges::any_of(
          all, [&](const dds::Diagnostic& known) { return is_same(known, diagnostic); });
      if (!is_known) all.push_back(std::move(diagnostic));
    }
  }
  std::ranges::stable_sort(all, std::ranges::greater(), &dds::Diagnostic::severity);
  return all;
}

}  // namespace stillmap::cli
