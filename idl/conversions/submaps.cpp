#include "idl/conversions/submaps.hpp"

#include <cmath>

#include "idl/conversions/header.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/interface/topics.hpp"
#include "submaps.h"

namespace stillmap::wire {
namespace {

std::optional<SubmapList::Entry> from_wire(const stillmap_msgs::msg::Submap& message) {
  const auto stamp = stamp_ns(message.stamp());
  const auto pose = to_isometry(message.pose());
  if (!stamp || !pose || !std::isfinite(message.way_m())) return std::nullopt;
  return SubmapList::Entry{*stamp, message.way_m(), *pose};
}

std::optional<SubmapList::Loop> from_wire(const stillmap_msgs::msg::LoopClosure& message,
                                          std::size_t submaps) {
  const auto pose = to_isometry(message.pose());
  const bool is_known =
      message.from_submap() < message.to_submap() && message.to_submap() < submaps;
  const bool is_finite = std::isfinite(message.overlap()) && std::isfinite(message.score()) &&
                         std::isfinite(message.jump_m());
  if (!pose || !is_known || !is_finite) return std::nullopt;
  return SubmapList::Loop{.from = message.from_submap(),
                          .to = message.to_submap(),
                          .T_from_to = *pose,
                          .overlap = message.overlap(),
                          .upright_fit = message.score(),
                          .jump_m = message.jump_m()};
}

}  // namespace

stillmap_msgs::msg::SubmapList to_wire(const SubmapsOfMap& submaps) {
  stillmap_msgs::msg::SubmapList message;
  message.format_version(dds::wire_format_version);
  const auto& entries = submaps.list.submaps;
  message.header(to_header(entries.empty() ? 0 : entries.back().stamp_ns, submaps.frame));
  message.child_frame_id(submaps.child_frame);
  message.map_id(submaps.map_id);
  message.graph_revision(submaps.list.graph_revision);
  for (const SubmapList::Entry& entry : entries) {
    auto& submap = message.submaps().emplace_back();
    submap.stamp(to_stamp(entry.stamp_ns));
    submap.way_m(entry.way_m);
    submap.pose(to_pose(entry.T_map_submap));
  }
  for (const SubmapList::Loop& loop : submaps.list.loops) {
    auto& closure = message.loops().emplace_back();
    closure.from_submap(static_cast<std::uint32_t>(loop.from));
    closure.to_submap(static_cast<std::uint32_t>(loop.to));
    closure.pose(to_pose(loop.T_from_to));
    closure.overlap(loop.overlap);
    closure.score(loop.upright_fit);
    closure.jump_m(loop.jump_m);
  }
  return message;
}

std::optional<SubmapsOfMap> from_wire(const stillmap_msgs::msg::SubmapList& message) {
  if (message.format_version() != dds::wire_format_version) return std::nullopt;
  SubmapsOfMap submaps{
      .map_id = message.map_id(),
      .frame = message.header().frame_id(),
      .child_frame = message.child_frame_id(),
      .list = {.graph_revision = message.graph_revision(), .submaps = {}, .loops = {}}};
  for (const auto& submap : message.submaps()) {
    const auto entry = from_wire(submap);
    if (!entry) return std::nullopt;
    submaps.list.submaps.push_back(*entry);
  }
  for (const auto& closure : message.loops()) {
    const auto loop = from_wire(closure, submaps.list.submaps.size());
    if (!loop) return std::nullopt;
    submaps.list.loops.push_back(*loop);
  }
  return submaps;
}

}  // namespace stillmap::wire
