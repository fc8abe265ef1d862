#include "idl/dds/ros_graph.hpp"

#include <algorithm>
#include <array>
#include <fastdds/dds/publisher/DataWriter.hpp>

#include "idl/dds/serialized_sample.hpp"
#include "idl/dds/type_support.hpp"
#include "rmw_dds_common.h"
#include "rmw_dds_common_iron.h"

namespace stillmap::dds {
namespace {

using HumbleInfo = rmw_dds_common::msg::ParticipantEntitiesInfo;
using IronInfo = rmw_dds_common_iron::msg::ParticipantEntitiesInfo;

constexpr std::uint32_t iron_gid_bytes = 16;

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

RosGraph::RosGraph(Participant& participant, const Guid& participant_guid)
    : participant_guid_(participant_guid),
      node_name_(participant.options().node_name),
      gid_bytes_(participant.options().ros_gid_bytes),
      writer_(participant.make_writer(ros_discovery_topic,
                                      serialized_sample_type(ros_discovery_type),
                                      {.transient_local = true, .depth = 1}, nullptr)) {
  announce();
}

void RosGraph::add_reader(const Guid& reader) {
  readers_.push_back(reader);
  announce();
}

void RosGraph::add_writer(const Guid& writer) {
  writers_.push_back(writer);
  announce();
}

void RosGraph::remove(const Guid& endpoint) {
  std::erase(readers_, endpoint);
  std::erase(writers_, endpoint);
  announce();
}

void RosGraph::announce() {
  if (gid_bytes_ == iron_gid_bytes) {
    announce_as<IronInfo>();
  } else {
    announce_as<HumbleInfo>();
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
