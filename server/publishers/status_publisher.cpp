#include "server/publishers/status_publisher.hpp"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include "core/process/host_name.hpp"
#include "idl/conversions/status.hpp"
#include "idl/dds/transports.hpp"
#include "idl/interface/participant_diagnostics.hpp"

namespace stillmap::server {
namespace {

// How soon a change of health is told.
constexpr std::chrono::duration<double> poll_period{0.1};

void log(const dds::Diagnostic& diagnostic) {
  spdlog::warn("{}: {}; {}", diagnostic.what, diagnostic.evidence, diagnostic.hint);
}

/// How segmentation is reduced because the machine is too slow; empty when it is not.
std::string reduced_pace(const dds::SegmentationStatus& segmentation) {
  std::string what;
  if (segmentation.interval > 1) {
    what =
        dds::every_nth_scan(segmentation.interval) + " is segmented, labels are propagated between";
  }
  if (segmentation.image_columns > 0 && segmentation.image_columns < segmentation.full_columns) {
    what += (what.empty() ? "" : "; ") + std::string("range images are ") +
            std::to_string(segmentation.image_columns) + " columns wide instead of " +
            std::to_string(segmentation.full_columns);
  }
  return what.empty() ? what : "segmentation cannot keep the sensor's rate: " + what;
}

}  // namespace

DiscoveryDiagnostics::DiscoveryDiagnostics(dds::Participant& participant,
                                           const std::string& name_space)
    : participant_(participant), name_space_(name_space), namesakes_(participant, name_space) {}

std::vector<dds::Diagnostic> DiscoveryDiagnostics::diagnostics() {
  const std::scoped_lock lock(mutex_);
  const auto now = Clock::now();
  if (now - collected_ < std::chrono::seconds(1)) return last_;
  collected_ = now;
  last_ = collect();
  for (const dds::Diagnostic& diagnostic : last_) {
    if (logged_.add(diagnostic.what + diagnostic.evidence)) log(diagnostic);
  }
  return last_;
}

std::string DiscoveryDiagnostics::namesake_refusal() {
  const std::vector<dds::RemoteParticipant> others =
      namesakes_.among(participant_.remote_participants());
  if (others.empty()) return {};
  std::string text = "it reaches " + std::to_string(others.size() + 1) + " servers called '" +
                     name_space_ + "', this one (" + host_name() + ", process " +
                     std::to_string(::getpid()) + ")";
  for (const dds::RemoteParticipant& other : others) {
    // The client may be on another host: "this host" would tell it nothing.
    const std::string host = other.host.substr(0, other.host.find(':'));
    text += " and another (" +
            (host.empty() ? describe_location(other) : host + ", process " + other.process) + ")";
  }
  return text +
         ", so none carries it out: stop all but one, or give each its own topics.namespace or "
         "domain (one that was killed counts for a few seconds)";
}

std::vector<dds::Diagnostic> DiscoveryDiagnostics::collect() {
  const dds::RemoteParticipant self = participant_.self();
  const std::vector<dds::RemoteParticipant> peers = participant_.remote_participants();
  std::vector<dds::Diagnostic> all =
      dds::namesake_diagnostics(name_space_, namesakes_.among(peers));
  for (dds::Diagnostic& diagnostic : dds::mismatch_diagnostics(dds::mismatches_of(self, peers))) {
    all.push_back(std::move(diagnostic));
  }
  for (dds::Diagnostic& diagnostic : dds::security_diagnostics(self, peers)) {
    all.push_back(std::move(diagnostic));
  }
  return all;
}

std::vector<dds::Diagnostic> host_diagnostics(const dds::Participant& participant) {
  std::vector<dds::Diagnostic> all;
  const std::uint32_t wanted_bytes = participant.options().socket_buffer_bytes;
  const std::uint32_t granted_bytes = dds::granted_socket_buffer_bytes(wanted_bytes);
  if (granted_bytes < wanted_bytes) {
    all.push_back({.severity = dds::Severity::advice,
                   .what = "UDP buffers are too small: large clouds over UDP can get lost",
                   .evidence = "they have " + std::to_string(granted_bytes) + " bytes instead of " +
                               std::to_string(wanted_bytes),
                   .hint = "sudo sysctl net.core.rmem_max=" + std::to_string(wanted_bytes)});
  }
  for (const std::string& host : participant.unresolved_peers()) {
    all.push_back({.severity = dds::Severity::problem,
                   .what = "the peer '" + host + "' is not looked for",
                   .evidence = "no IPv4 address was known for it when the server started",
                   .hint = "give its address in dds.peers, or start the server again when the "
                           "name can be resolved; a peer that lists the server finds it anyway"});
  }
  for (const dds::Diagnostic& diagnostic : all) log(diagnostic);
  return all;
}

ServerReport::ServerReport(ServerTraits traits, const LatestMap& latest_map,
                           const Statistics& statistics,
                           std::function<std::vector<dds::Diagnostic>()> discovery_diagnostics,
                           std::function<std::string()> no_input_reason)
    : traits_(std::move(traits)),
      host_(host_name()),
      latest_map_(latest_map),
      statistics_(statistics),
      discovery_diagnostics_(std::move(discovery_diagnostics)),
      no_input_reason_(std::move(no_input_reason)) {}

dds::ServerStatus ServerReport::status() const {
  const auto view = latest_map_.view();
  const std::string live_labels = latest_map_.label_source();
  const auto wall_clock = std::chrono::system_clock::now().time_since_epoch();
  const auto uptime = std::chrono::steady_clock::now() - statistics_.started();
  dds::ServerStatus status;
  status.stamp_ns = std::chrono::nanoseconds(wall_clock).count();
  status.software_version = STILLMAP_VERSION;
  status.uptime_s = std::chrono::duration<double>(uptime).count();
  status.delivery = traits_.delivery;
  status.label_source = live_labels.empty() ? traits_.label_source : live_labels;
  status.host = host_;
  status.sensor = statistics_.sensor();
  if (status.sensor.empty()) status.sensor = "not known yet";
  status.points_topic = traits_.points_topic;
  status.health = latest_map_.health();
  status.map_version = view->version;
  status.map_id = view->map_id;
  status.tile_count = view->tiles.size();
  status.voxel_count = view->tiles.voxel_count();
  statistics_.report_to(status);
  status.diagnostics = discovery_diagnostics_();
  status.diagnostics.insert(status.diagnostics.end(), traits_.host_diagnostics.begin(),
                            traits_.host_diagnostics.end());
  status.reason = reason(status);
  return status;
}

std::string ServerReport::reason(const dds::ServerStatus& status) const {
  if (const std::string failure = statistics_.last_save_failure(); !failure.empty()) {
    return "the map cannot be saved, what is mapped is in memory alone: " + failure;
  }
  std::string all = mapping_fault(status);
  for (const std::string& told : {statistics_.map_displaced(), statistics_.maps_left()}) {
    if (!told.empty()) all += (all.empty() ? "" : "; ") + told;
  }
  return all;
}

std::string ServerReport::mapping_fault(const dds::ServerStatus& status) const {
  if (const std::string why = no_input_reason_(); !why.empty()) return why;
  if (const std::string drop = statistics_.last_drop(); !drop.empty()) {
    return "the last scan was dropped: " + drop;
  }
  const std::string search = statistics_.place_search();
  if (status.health == OdometryHealth::lost) {
    return "the odometry is lost: the last scan does not fit the map" +
           (search.empty() ? search : "; " + search);
  }
  if (!search.empty()) return "nothing confirms the place: " + search;
  if (const std::string failure = statistics_.last_segmentation_failure(); !failure.empty()) {
    return "the last scan could not be segmented: " + failure;
  }
  if (status.received_hz == 0.0) return "no scan for the last seconds";
  if (const std::string pace = reduced_pace(status.segmentation); !pace.empty()) return pace;
  if (const std::string faults = statistics_.input_faults(); !faults.empty()) return faults;
  return status.diagnostics.empty() ? std::string() : status.diagnostics.front().what;
}

StatusPublisher::StatusPublisher(dds::Participant& participant, const dds::Topics& topics,
                                 double period_s, std::function<dds::ServerStatus()> status)
    : period_(period_s),
      status_(std::move(status)),
      writer_(participant, topics.status.dds_name, topics.status.writer),
      worker_("status", std::min(poll_period, period_),
              [this](const std::stop_token&) { publish_when_due(); }) {}

void StatusPublisher::publish_when_due() {
  const dds::ServerStatus status = status_();
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ < period_ && status.health == last_health_) return;
  last_ = now;
  last_health_ = status.health;
  // A keep-last writer always has room.
  static_cast<void>(writer_.write(wire::to_wire(status)));
}

}  // namespace stillmap::server
