#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/graph/live_loop_closer.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "tf2_msgs.h"

namespace stillmap::server {

/// Tells where the running map lies on the earth: on /tf_static from `earth` (REP 105, ECEF) to the
/// map, in the log, and in the map's file. Used by the mapping thread.
class EarthFrame {
 public:
  /// The participant must outlive it.
  EarthFrame(dds::Participant& participant, const dds::Topics& topics, std::string map_frame);

  /// Another map began: who joins from now on is not told where the last one lay.
  void forget() {
    place_.reset();
    tf_static_.reset();
    is_withdrawn_ = false;
  }
  /// The place of this map was found wrong.
  void withdraw() {
    forget();
    is_withdrawn_ = true;
  }
  /// Whether what was told of this map before is none any more, and nothing else is known.
  [[nodiscard]] bool is_withdrawn() const { return is_withdrawn_ && !place_; }
  /// A better place of the map; one that hardly differs from the last is not told.
  void publish(std::int64_t stamp_ns, const MapOnEarth& place);
  /// As datum_from_text() reads it; empty where it is not known.
  [[nodiscard]] std::string datum() const { return place_ ? to_text(place_->datum) : ""; }

 private:
  dds::Participant& participant_;
  dds::TopicSpec<tf2_msgs::msg::TFMessage> topic_;
  std::string map_frame_;
  /// While the place is known.
  std::optional<dds::Writer<tf2_msgs::msg::TFMessage>> tf_static_;
  std::optional<MapOnEarth> place_;
  bool is_withdrawn_ = false;
};

}  // namespace stillmap::server
