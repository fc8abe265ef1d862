#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "tests/ros/cyclone_peer/commands.hpp"
#include "tests/ros/cyclone_peer/endpoints.hpp"
#include "tests/ros/cyclone_peer/report.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::peer {
namespace {

using namespace std::chrono_literals;
using Announcement = rmw_dds_common_msg_dds__ParticipantEntitiesInfo_;
using Guid = std::array<std::uint8_t, 16>;

constexpr auto discovery_timeout = 120s * test::slowdown;
// The server stays while all other tests ask it.
constexpr auto run_timeout = 500s * test::slowdown;
constexpr auto announcements = "ros_discovery_info";

template <typename Bytes>
Guid guid_of(const Bytes& bytes) {
  Guid guid;
  std::copy_n(bytes, guid.size(), guid.begin());
  return guid;
}

/// What a node announces of itself.
struct Node {
  Guid participant;
  std::string full_name;
  std::set<Guid> readers, writers;
  bool has_padding = true;
};

std::optional<Node> find_node(const Announcement& announcement, const std::string& name) {
  for (const auto& info : elements(announcement.node_entities_info_seq)) {
    if (name != info.node_name) continue;
    Node node{.participant = guid_of(announcement.gid.data),
              .full_name = std::string(info.node_namespace) + info.node_name,
              .readers = {},
              .writers = {}};
    const auto add = [&](std::set<Guid>& to, const auto& gid) {
      to.insert(guid_of(gid.data));
      node.has_padding &= std::all_of(std::begin(gid.data) + node.participant.size(),
                                      std::end(gid.data), [](int byte) { return byte == 0; });
    };
    for (const auto& gid : elements(info.reader_gid_seq)) add(node.readers, gid);
    for (const auto& gid : elements(info.writer_gid_seq)) add(node.writers, gid);
    return node;
  }
  return std::nullopt;
}

/// An endpoint that Cyclone discovered.
struct Endpoint {
  Guid participant;
  std::string topic, type, reliability, durability, user_data;
};

std::string user_data_of(const dds_qos_t* qos) {
  void* bytes = nullptr;
  std::size_t size = 0;
  dds_qget_userdata(qos, &bytes, &size);
  std::string text = size == 0 ? "" : std::string(static_cast<const char*>(bytes), size);
  dds_free(bytes);
  return text;
}

Endpoint endpoint_of(const dds_builtintopic_endpoint_t& found) {
  dds_reliability_kind_t reliability{};
  dds_durability_kind_t durability{};
  dds_qget_reliability(found.qos, &reliability, nullptr);
  dds_qget_durability(found.qos, &durability);
  return {
      .participant = guid_of(found.participant_key.v),
      .topic = found.topic_name,
      .type = found.type_name,
      .reliability = reliability == DDS_RELIABILITY_RELIABLE ? "RELIABLE" : "BEST_EFFORT",
      .durability = durability == DDS_DURABILITY_TRANSIENT_LOCAL ? "TRANSIENT_LOCAL" : "VOLATILE",
      .user_data = user_data_of(found.qos)};
}

/// What Cyclone itself knows of a kind of endpoint (DCPSPublication, DCPSSubscription).
class Discovery {
 public:
  Discovery(const Participant& participant, dds_entity_t builtin_topic)
      : reader_(checked(dds_create_reader(participant.entity(), builtin_topic, nullptr, nullptr),
                        "discovery")) {}
  ~Discovery() { dds_delete(reader_); }
  Discovery(const Discovery&) = delete;
  Discovery& operator=(const Discovery&) = delete;

  /// The endpoints of a participant, without the writer of the announcements themselves.
  [[nodiscard]] std::map<Guid, Endpoint> of(const Guid& participant) const {
    std::map<Guid, Endpoint> found;
    constexpr std::size_t most = 2000;
    std::vector<void*> samples(most, nullptr);
    std::vector<dds_sample_info_t> infos(most);
    const auto count = dds_read(reader_, samples.data(), infos.data(), most, most);
    for (std::int32_t i = 0; i < count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (!infos[at].valid_data || infos[at].instance_state != DDS_ALIVE_INSTANCE_STATE) continue;
      const auto& sample = *static_cast<const dds_builtintopic_endpoint_t*>(samples[at]);
      const Endpoint endpoint = endpoint_of(sample);
      if (endpoint.participant != participant || endpoint.topic == announcements) continue;
      found.emplace(guid_of(sample.key.v), endpoint);
    }
    if (count > 0) dds_return_loan(reader_, samples.data(), count);
    return found;
  }

 private:
  dds_entity_t reader_;
};

std::set<Guid> keys(const std::map<Guid, Endpoint>& endpoints) {
  std::set<Guid> all;
  for (const auto& [guid, endpoint] : endpoints) all.insert(guid);
  return all;
}

void print(const std::string& kind, const std::map<Guid, Endpoint>& endpoints) {
  std::vector<Endpoint> sorted;
  for (const auto& [guid, endpoint] : endpoints) sorted.push_back(endpoint);
  std::ranges::sort(sorted, {}, &Endpoint::topic);
  for (const Endpoint& endpoint : sorted) {
    Line(kind)
        .add("topic", endpoint.topic)
        .add("type", endpoint.type)
        .add("reliability", endpoint.reliability)
        .add("durability", endpoint.durability)
        .add("user_data", endpoint.user_data);
  }
}

/// The user data of a discovered participant; nothing once it has gone.
std::optional<std::string> user_data(const Participant& participant, const Guid& wanted) {
  const dds_entity_t reader = checked(
      dds_create_reader(participant.entity(), DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr),
      "discovery of participants");
  std::optional<std::string> text;
  void* sample = nullptr;
  dds_sample_info_t info;
  while (dds_take(reader, &sample, &info, 1, 1) > 0) {
    const auto& found = *static_cast<const dds_builtintopic_participant_t*>(sample);
    if (info.valid_data && info.instance_state == DDS_ALIVE_INSTANCE_STATE &&
        guid_of(found.key.v) == wanted) {
      text = user_data_of(found.qos);
    }
    dds_return_loan(reader, &sample, 1);
    sample = nullptr;
  }
  dds_delete(reader);
  return text;
}

}  // namespace

int watch_graph(const ServerAddress& address, const std::string& name) {
  const Participant participant(address.domain_id);
  Reader<Announcement> reader(participant, announcements, {.transient_local = true, .depth = 1000});
  const Discovery publications(participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION);
  const Discovery subscriptions(participant, DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION);
  std::optional<Node> node;
  int updates = 0;
  auto last_news = std::chrono::steady_clock::now();
  // A server that starts announces each endpoint; once it is quiet, all are there.
  const auto is_quiet = [&] {
    reader.take([&](const Announcement& announcement) {
      if (auto found = find_node(announcement, name)) {
        node = std::move(found);
        ++updates;
        last_news = std::chrono::steady_clock::now();
      }
    });
    return node && std::chrono::steady_clock::now() - last_news > 2s * test::slowdown;
  };
  if (!wait_until(is_quiet, discovery_timeout)) throw std::runtime_error("no node " + name);
  const auto writers = publications.of(node->participant);
  const auto readers = subscriptions.of(node->participant);
  Line("node")
      .add("name", node->full_name)
      .add("user_data", user_data(participant, node->participant).value_or("none"))
      .add("announcements", updates);
  Line("writers")
      .add("announced", node->writers.size())
      .add("discovered", writers.size())
      .add("same_gids", node->writers == keys(writers));
  Line("readers")
      .add("announced", node->readers.size())
      .add("discovered", readers.size())
      .add("same_gids", node->readers == keys(readers));
  Line("gids").add("rest_is_zero", node->has_padding);
  print("writer", writers);
  print("reader", readers);
  const auto is_gone = [&] { return !user_data(participant, node->participant); };
  Line("node").add("has_left", wait_until(is_gone, run_timeout));
  return 0;
}

}  // namespace stillmap::peer
