#pragma once

#include <dds/dds.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>

#include "ros2_peer.h"

// The few parts of Cyclone DDS that the peer uses, with owners.

namespace stillmap::peer {

/// What idlc made of a type. Defined for the types that PEER_TYPE lists below.
template <typename T>
const dds_topic_descriptor_t& descriptor();

#define PEER_TYPE(name)                                     \
  template <>                                               \
  inline const dds_topic_descriptor_t& descriptor<name>() { \
    return name##_desc;                                     \
  }
#define PEER_SERVICE(stem)   \
  PEER_TYPE(stem##_Request_) \
  PEER_TYPE(stem##_Response_)

PEER_TYPE(sensor_msgs_msg_dds__PointCloud2_)
PEER_TYPE(nav_msgs_msg_dds__Odometry_)
PEER_TYPE(nav_msgs_msg_dds__Path_)
PEER_TYPE(nav_msgs_msg_dds__OccupancyGrid_)
PEER_TYPE(tf2_msgs_msg_dds__TFMessage_)
PEER_TYPE(octomap_msgs_msg_dds__Octomap_)
PEER_TYPE(rmw_dds_common_msg_dds__ParticipantEntitiesInfo_)
PEER_TYPE(stillmap_msgs_msg_dds__TileInfo_)
PEER_TYPE(stillmap_msgs_msg_dds__MapTile_)
PEER_TYPE(stillmap_msgs_msg_dds__Status_)
PEER_SERVICE(nav_msgs_srv_dds__GetMap)
PEER_SERVICE(octomap_msgs_srv_dds__GetOctomap)
PEER_SERVICE(stillmap_msgs_srv_dds__GetStatus)
PEER_SERVICE(stillmap_msgs_srv_dds__GetStaticMap)
PEER_SERVICE(stillmap_msgs_srv_dds__GetTileVersions)
PEER_SERVICE(stillmap_msgs_srv_dds__GetTiles)
PEER_SERVICE(stillmap_msgs_srv_dds__GetTraversableArea)
PEER_SERVICE(stillmap_msgs_srv_dds__CheckPath)
PEER_SERVICE(stillmap_msgs_srv_dds__NearestTraversable)
PEER_SERVICE(stillmap_msgs_srv_dds__QueryOccupancy)
PEER_SERVICE(stillmap_msgs_srv_dds__GetRemoved)
PEER_SERVICE(stillmap_msgs_srv_dds__SaveMap)

#undef PEER_SERVICE
#undef PEER_TYPE

/// A handle of Cyclone's, or its error in words with what was tried.
inline dds_entity_t checked(dds_entity_t entity, const std::string& what) {
  if (entity < 0) throw std::runtime_error(what + ": " + dds_strretcode(-entity));
  return entity;
}

/// As rmw_cyclonedds sets it.
struct Qos {
  bool reliable = true;
  bool transient_local = false;
  int depth = 10;
  /// Keep all, and let a write wait this long for room.
  bool keep_all = false;
};

[[nodiscard]] std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)> make_qos(const Qos& qos);

/// A DDS participant; what it made goes with it.
class Participant {
 public:
  explicit Participant(std::uint32_t domain_id);
  ~Participant() { dds_delete(entity_); }
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  [[nodiscard]] dds_entity_t entity() const { return entity_; }
  [[nodiscard]] dds_entity_t topic(const dds_topic_descriptor_t& type,
                                   const std::string& name) const;

 private:
  dds_entity_t entity_;
};

/// Looks every few milliseconds; false after `timeout`.
[[nodiscard]] bool wait_until(const std::function<bool()>& condition,
                              std::chrono::milliseconds timeout);

template <typename T>
class Reader {
 public:
  Reader(const Participant& participant, const std::string& topic, const Qos& qos)
      : entity_(checked(
            dds_create_reader(participant.entity(), participant.topic(descriptor<T>(), topic),
                              make_qos(qos).get(), nullptr),
            "reader of " + topic)) {}
  ~Reader() { dds_delete(entity_); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  /// Hands over every sample that has come.
  void take(const std::function<void(const T&)>& handle) {
    void* sample = nullptr;
    dds_sample_info_t info;
    while (dds_take(entity_, &sample, &info, 1, 1) > 0) {
      if (info.valid_data) handle(*static_cast<const T*>(sample));
      dds_return_loan(entity_, &sample, 1);
      sample = nullptr;
    }
  }

  [[nodiscard]] bool is_matched() const {
    dds_subscription_matched_status_t status{};
    dds_get_subscription_matched_status(entity_, &status);
    return status.current_count > 0;
  }

 private:
  dds_entity_t entity_;
};

template <typename T>
class Writer {
 public:
  Writer(const Participant& participant, const std::string& topic, const Qos& qos)
      : entity_(checked(
            dds_create_writer(participant.entity(), participant.topic(descriptor<T>(), topic),
                              make_qos(qos).get(), nullptr),
            "writer of " + topic)) {}
  ~Writer() { dds_delete(entity_); }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  void write(const T& sample) { checked(dds_write(entity_, &sample), "write"); }

  [[nodiscard]] bool is_matched() const {
    dds_publication_matched_status_t status{};
    dds_get_publication_matched_status(entity_, &status);
    return status.current_count > 0;
  }

 private:
  dds_entity_t entity_;
};

/// The elements of a sequence that idlc made.
template <typename Sequence>
[[nodiscard]] auto elements(const Sequence& sequence) {
  return std::span(sequence._buffer, sequence._length);
}

/// Lends memory of the caller's to a sequence that idlc made.
template <typename Sequence, typename Container>
void lend(Sequence& sequence, Container& memory) {
  sequence._maximum = sequence._length = static_cast<std::uint32_t>(memory.size());
  sequence._buffer = memory.data();
  sequence._release = false;
}

}  // namespace stillmap::peer
