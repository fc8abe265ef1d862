#include "idl/dds/ros_graph.hpp"

#include <algorithm>
#include <array>
#include <fastdds/dds/publisher/DataWriter.hpp>

#include "idl/dds/discovery_monitor.hpp"
#include "idl/dds/serialized_sample.hpp"
#include "idl/dds/type_support.hpp"
#include "rmw_dds_common.h"
#include "rmw_dds_common_iron.h"

namespace stillmap::dds {
namespace {

using HumbleInfo = rmw_dds_common::msg::ParticipantEntitiesInfo;
using IronInfo = rmw_dds_common_iron::msg::ParticipantEntitiesInfo;

template <typename Gid>
Gid to_gid(const RosGraph::Guid& guid) {
  std::remove_cvref_t<decltype(std::declval<Gid&>().data())> bytes{};
  const auto tail = std::copy_n(guid.guidPrefix.value, guid.guidPrefix.size, bytes.begin());
  std::copy_n(guid.entityId.value, guid.entityId.size, tail);
  Gid gid;
  gid.data(bytes);
  return gid;
}

}  // namespace

RosGraph::RosGraph(Participant& participant, DiscoveryMonitor& monitor,
                   const Guid& participant_guid)
    : monitor_(monitor),
      participant_guid_(participant_guid),
      node_name_(participant.options().node_name),
      // As bytes: both layouts have one name.
      writer_(participant.make_writer(ros_discovery_topic,
                                      serialized_sample_type(ros_discovery_type),
                                      {.transient_local = true, .depth = 1}, nullptr)),
      follower_([this](const std::stop_token& stop) { follow_peers(stop); }) {
  monitor_.watch_ros_peers([this] { wake_follower(); });
  // For those that came in the meantime.
  wake_follower();
}

void RosGraph::wake_follower() {
  const std::scoped_lock lock(wake_mutex_);
  peers_changed_ = true;
  wake_.notify_all();
}

RosGraph::~RosGraph() { monitor_.watch_ros_peers({}); }

void RosGraph::add_reader(const Guid& reader) {
  const std::scoped_lock lock(mutex_);
  readers_.push_back(reader);
  announce();
}

void RosGraph::add_writer(const Guid& writer) {
  const std::scoped_lock lock(mutex_);
  writers_.push_back(writer);
  announce();
}

void RosGraph::remove(const Guid& endpoint) {
  const std::scoped_lock lock(mutex_);
  std::erase(readers_, endpoint);
  std::erase(writers_, endpoint);
  announce();
}

void RosGraph::follow_peers(const std::stop_token& stop) {
  // A write from within discovery would wait for discovery.
  while (!stop.stop_requested()) {
    {
      std::unique_lock lock(wake_mutex_);
      if (!wake_.wait(lock, stop, [this] { return peers_changed_; })) return;
      peers_changed_ = false;
    }
    const std::optional<RosGids> needed = monitor_.ros_gids();
    const std::scoped_lock lock(mutex_);
    if (!needed || layout_ == needed) continue;
    // What was told stays true for who understands both.
    const bool must_tell = *needed != RosGids::any || !layout_;
    layout_ = needed;
    if (must_tell) announce();
  }
}

void RosGraph::announce() {
  if (!layout_) return;
  if (*layout_ == RosGids::of_24_bytes) {
    announce_as<HumbleInfo>();
  } else {
    announce_as<IronInfo>();
  }
}

template <typename Info>
void RosGraph::announce_as() {
  using Nodes = std::remove_cvref_t<decltype(std::declval<Info&>().node_entities_info_seq())>;
  using Gid = std::remove_cvref_t<decltype(std::declval<Info&>().gid())>;
  typename Nodes::value_type node;
  node.node_namespace("/");
  node.node_name(node_name_);
  for (const Guid& reader : readers_) node.reader_gid_seq().push_back(to_gid<Gid>(reader));
  for (const Guid& writer : writers_) node.writer_gid_seq().push_back(to_gid<Gid>(writer));
  Info info;
  info.gid(to_gid<Gid>(participant_guid_));
  info.node_entities_info_seq().push_back(node);
  SerializedSample bytes = to_bytes(type_support<Info>(), &info, 0);
  writer_->write(&bytes);
}

}  // namespace stillmap::dds
