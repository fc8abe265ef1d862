#include "idl/dds/discovery_monitor.hpp"

#include <fastdds/rtps/participant/ParticipantDiscoveryInfo.h>
#include <fastdds/rtps/reader/ReaderDiscoveryInfo.h>
#include <fastdds/rtps/writer/WriterDiscoveryInfo.h>

#include <algorithm>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <sstream>

#include "core/process/host_name.hpp"
#include "idl/dds/shown_text.hpp"

namespace stillmap::dds {
namespace {

using namespace eprosima::fastrtps::rtps;
using eprosima::fastdds::dds::DomainParticipant;

// A handshake takes a fraction of a second, and one more for each of its messages that gets lost.
constexpr std::chrono::seconds time_to_authenticate{2};

template <typename T>
std::string streamed(const T& value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

/// Anybody may announce anything. Names of DDS and ROS 2 have up to 255 bytes.
std::string shown(std::string_view text) { return shown_text(text, 255); }

std::string vendor_name(const VendorId_t& vendor) {
  struct Named {
    int high, low;
    const char* name;
  };
  constexpr Named known[] = {{1, 1, "RTI Connext"},  {1, 3, "OpenDDS"},    {1, 15, "Fast DDS"},
                             {1, 16, "Cyclone DDS"}, {1, 2, "OpenSplice"}, {1, 10, "Connext Micro"},
                             {1, 18, "RustDDS"}};
  for (const Named& one : known) {
    if (vendor[0] == one.high && vendor[1] == one.low) return one.name;
  }
  return "vendor " + std::to_string(vendor[0]) + "." + std::to_string(vendor[1]);
}

std::string property(const ParticipantProxyData& data, const std::string& name) {
  for (const auto& pair : data.m_properties) {
    if (pair.first() == name) return shown(pair.second());
  }
  return {};
}

void add_locators(const RemoteLocatorList& locators, RemoteParticipant& peer) {
  for (const Locator_t& locator : locators.unicast) {
    if (locator.kind == LOCATOR_KIND_SHM) peer.uses_shared_memory = true;
    if (locator.kind != LOCATOR_KIND_UDPv4) continue;
    const auto* bytes = &locator.address[12];
    std::string address;
    for (int i = 0; i < 4; ++i) {
      if (i > 0) address += '.';
      address += std::to_string(bytes[i]);
    }
    if (std::ranges::find(peer.addresses, address) == peer.addresses.end()) {
      peer.addresses.push_back(address);
    }
  }
}

// Fast DDS writes a number of the machine into every guid, but not into that of a secured
// participant, which belongs to its certificate. Those announce the name of their host.
bool same_host(const GuidPrefix_t& ours, const VendorId_t& vendor, const GuidPrefix_t& theirs,
               const RemoteParticipant& peer) {
  if (!peer.host.empty() && peer.host.starts_with(host_name() + ":")) return true;
  const bool is_fast_dds = vendor[0] == 1 && vendor[1] == 15;
  return is_fast_dds && std::equal(&ours.value[2], &ours.value[4], &theirs.value[2]);
}

RemoteParticipant remote_participant_from(const ParticipantProxyData& data,
                                          const GuidPrefix_t& ours) {
  RemoteParticipant peer;
  peer.guid = streamed(data.m_guid.guidPrefix);
  peer.name = shown(data.m_participantName.to_string());
  peer.vendor = vendor_name(data.m_VendorId);
  peer.host = property(data, eprosima::fastdds::dds::parameter_policy_physical_data_host);
  peer.user = property(data, eprosima::fastdds::dds::parameter_policy_physical_data_user);
  peer.process = property(data, eprosima::fastdds::dds::parameter_policy_physical_data_process);
  add_locators(data.default_locators, peer);
  peer.is_on_this_host = same_host(ours, data.m_VendorId, data.m_guid.guidPrefix, peer);
  peer.is_secured = !data.identity_token_.class_id().empty();
  return peer;
}

template <typename Time>
std::optional<std::chrono::nanoseconds> finite(const Time& time) {
  if (time == eprosima::fastrtps::c_TimeInfinite) return std::nullopt;
  return std::chrono::nanoseconds(time.to_ns());
}

template <typename Qos>
EndpointQos qos_from(const Qos& qos) {
  using namespace eprosima::fastdds::dds;
  EndpointQos out{.reliable = qos.m_reliability.kind == RELIABLE_RELIABILITY_QOS,
                  .durability = static_cast<Durability>(qos.m_durability.kind),
                  .deadline = finite(qos.m_deadline.period),
                  .liveliness_kind = static_cast<int>(qos.m_liveliness.kind),
                  .liveliness_lease = finite(qos.m_liveliness.lease_duration),
                  .exclusive_ownership = qos.m_ownership.kind == EXCLUSIVE_OWNERSHIP_QOS,
                  .partitions = {}};
  for (auto it = qos.m_partition.begin(); it != qos.m_partition.end(); ++it) {
    out.partitions.push_back(shown(it->name()));
  }
  return out;
}

template <typename ProxyData>
std::string user_data_of(const ProxyData& data) {
  // ROS 2's are shorter.
  constexpr std::size_t max_bytes = 256;
  const auto& bytes = data.m_qos.m_userData;
  return {bytes.begin(),
          bytes.begin() + static_cast<std::ptrdiff_t>(std::min(max_bytes, bytes.size()))};
}

template <typename ProxyData>
Endpoint endpoint_from(ProxyData& data, bool is_writer) {
  return {.guid = streamed(data.guid()),
          .topic = shown(data.topicName().to_string()),
          .type = shown(data.typeName().to_string()),
          .is_writer = is_writer,
          .is_keyed = data.topicKind() == WITH_KEY,
          .user_data = user_data_of(data),
          .qos = qos_from(data.m_qos)};
}

}  // namespace

void DiscoveryMonitor::add_local_endpoint(const Guid& guid, const std::string& topic,
                                          const std::string& type, bool is_keyed, bool is_writer,
                                          const TopicQos& qos) {
  Endpoint endpoint{.guid = streamed(guid),
                    .topic = topic,
                    .type = type,
                    .is_writer = is_writer,
                    .is_keyed = is_keyed,
                    .user_data = {},
                    .qos = {}};
  endpoint.qos.reliable = qos.reliable && !qos.accept_best_effort;
  if (qos.transient_local) endpoint.qos.durability = Durability::transient_local;
  const std::scoped_lock lock(mutex_);
  local_endpoints_[guid] = std::move(endpoint);
}

void DiscoveryMonitor::remove_local_endpoint(const Guid& guid) {
  const std::scoped_lock lock(mutex_);
  local_endpoints_.erase(guid);
}

std::vector<RemoteParticipant> DiscoveryMonitor::remote_participants() const {
  const std::scoped_lock lock(mutex_);
  std::vector<RemoteParticipant> out;
  const auto now = Clock::now();
  for (const auto& [prefix, known] : participants_) {
    RemoteParticipant peer = known.peer;
    peer.unauthenticated = is_unauthenticated(known, now);
    for (const auto& [guid, endpoint] : remote_endpoints_) {
      if (guid.guidPrefix == prefix) peer.endpoints.push_back(endpoint);
    }
    out.push_back(std::move(peer));
  }
  return out;
}

std::vector<Endpoint> DiscoveryMonitor::local_endpoints() const {
  const std::scoped_lock lock(mutex_);
  std::vector<Endpoint> out;
  for (const auto& [guid, endpoint] : local_endpoints_) out.push_back(endpoint);
  return out;
}

void DiscoveryMonitor::on_participant_discovery(DomainParticipant* participant,
                                                ParticipantDiscoveryInfo&& info) {
  const Prefix& prefix = info.info.m_guid.guidPrefix;
  const std::scoped_lock lock(mutex_);
  if (info.status == ParticipantDiscoveryInfo::REMOVED_PARTICIPANT ||
      info.status == ParticipantDiscoveryInfo::DROPPED_PARTICIPANT) {
    participants_.erase(prefix);
    std::erase_if(remote_endpoints_,
                  [&](const auto& one) { return one.first.guidPrefix == prefix; });
    return;
  }
  const auto [known, is_new] = participants_.try_emplace(prefix);
  if (is_new) known->second.since = Clock::now();
  const bool refused = known->second.peer.refused;
  known->second.peer = remote_participant_from(info.info, participant->guid().guidPrefix);
  known->second.peer.refused = refused;
}

bool DiscoveryMonitor::is_unauthenticated(const Known& known, Clock::time_point now) const {
  if (!secured_ || !known.peer.is_secured || known.authenticated || known.peer.refused)
    return false;
  return now - known.since > time_to_authenticate;
}

void DiscoveryMonitor::onParticipantAuthentication(DomainParticipant*,
                                                   ParticipantAuthenticationInfo&& info) {
  const std::scoped_lock lock(mutex_);
  const bool refused = info.status == ParticipantAuthenticationInfo::UNAUTHORIZED_PARTICIPANT;
  // Only participants that were discovered before have more than a guid.
  const auto found = participants_.find(info.guid.guidPrefix);
  if (found == participants_.end()) return;
  found->second.peer.refused = refused;
  found->second.authenticated = !refused;
}

void DiscoveryMonitor::on_subscriber_discovery(DomainParticipant*, ReaderDiscoveryInfo&& info) {
  if (info.status == ReaderDiscoveryInfo::REMOVED_READER)
    return remove_remote_endpoint(info.info.guid());
  add_remote_endpoint(info.info.guid(), endpoint_from(info.info, false));
}

void DiscoveryMonitor::on_publisher_discovery(DomainParticipant*, WriterDiscoveryInfo&& info) {
  if (info.status == WriterDiscoveryInfo::REMOVED_WRITER)
    return remove_remote_endpoint(info.info.guid());
  add_remote_endpoint(info.info.guid(), endpoint_from(info.info, true));
}

void DiscoveryMonitor::add_remote_endpoint(const Guid& guid, Endpoint endpoint) {
  const bool is_of_graph = endpoint.topic == ros_discovery_topic;
  const std::scoped_lock lock(mutex_);
  remote_endpoints_[guid] = std::move(endpoint);
  if (is_of_graph && ros_peers_changed_) ros_peers_changed_();
}

void DiscoveryMonitor::remove_remote_endpoint(const Guid& guid) {
  const std::scoped_lock lock(mutex_);
  remote_endpoints_.erase(guid);
}

void DiscoveryMonitor::watch_ros_peers(std::function<void()> changed) {
  const std::scoped_lock lock(mutex_);
  ros_peers_changed_ = std::move(changed);
}

std::optional<RosGids> DiscoveryMonitor::ros_gids() const {
  const std::scoped_lock lock(mutex_);
  std::optional<RosGids> needed;
  for (const auto& [guid, endpoint] : remote_endpoints_) {
    const std::optional<RosGids> read = gids_read_by(endpoint);
    if (!read) continue;
    // Of two kinds, the newer one: it is the one that will stay.
    if (!needed || *needed == RosGids::any || *read == RosGids::of_16_bytes) needed = read;
  }
  return needed;
}

}  // namespace stillmap::dds
