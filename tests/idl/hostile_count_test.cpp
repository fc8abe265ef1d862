#include <gtest/gtest.h>

#include <cstring>
#include <tuple>

#include "idl/dds/ros_nodes.hpp"
#include "idl/dds/serialized_sample.hpp"
#include "localize.h"
#include "nav_msgs.h"
#include "removed_voxels.h"
#include "rmw_dds_common.h"
#include "sensor_msgs.h"
#include "stillmap_msgs.h"
#include "stillmap_occupancy.h"
#include "submaps.h"
#include "tf2_msgs.h"
#include "traversability.h"

// Samples whose sequences say that they have more elements than there are bytes for: what is made
// of them must take no more than a few times their bytes.

namespace stillmap::dds {
namespace {

constexpr std::size_t sample_bytes = 1'000'000;
constexpr std::size_t most_per_byte = 16;

/// Every sample that has `count` where a sample without elements has some four bytes, and zeros
/// behind.
template <typename T>
std::vector<SerializedSample> samples_with(std::uint32_t count) {
  const T empty;
  const SerializedSample fields = to_bytes(type_support<T>(), &empty, 0);
  std::vector<SerializedSample> all;
  for (std::size_t at = encapsulation_bytes; at + sizeof count <= fields.size();
       at += sizeof count) {
    SerializedSample sample = fields;
    sample.resize(sample_bytes);
    std::memcpy(&sample[at], &count, sizeof count);
    all.push_back(std::move(sample));
  }
  return all;
}

template <typename Sequence>
std::size_t bytes_of(const Sequence& sequence) {
  return sequence.capacity() * sizeof(typename Sequence::value_type);
}

/// Most memory of one of these sequences (getters of T) that a sample brought about.
template <typename T, typename... Getters>
std::size_t most_bytes(Getters... getters) {
  std::size_t most = 0;
  for (const std::uint32_t count : {900'000U, 0xFFFF'FFFFU}) {
    for (SerializedSample& bytes : samples_with<T>(count)) {
      T sample;
      static_cast<void>(from_bytes(type_support<T>(), bytes, &sample));
      most = std::max({most, bytes_of((sample.*getters)())...});
    }
  }
  return most;
}

template <typename T, typename Element>
using Getter = const std::vector<Element>& (T::*)() const;

TEST(HostileCount, TakesNoMoreThanAFewTimesTheBytesThatAreThere) {
  constexpr std::size_t most = most_per_byte * sample_bytes;
  using namespace stillmap_msgs::msg;
  using namespace stillmap_msgs::srv;
  using sensor_msgs::msg::PointCloud2;
  using tf2_msgs::msg::TFMessage;
  EXPECT_LT(most_bytes<PointCloud2>(
                Getter<PointCloud2, sensor_msgs::msg::PointField>(&PointCloud2::fields)),
            most);
  EXPECT_LT(most_bytes<TFMessage>(
                Getter<TFMessage, geometry_msgs::msg::TransformStamped>(&TFMessage::transforms)),
            most);
  EXPECT_LT(
      most_bytes<nav_msgs::msg::Path>(Getter<nav_msgs::msg::Path, geometry_msgs::msg::PoseStamped>(
          &nav_msgs::msg::Path::poses)),
      most);
  EXPECT_LT(most_bytes<Status>(Getter<Status, NamedCounter>(&Status::counters),
                               Getter<Status, Diagnostic>(&Status::diagnostics)),
            most);
  using Query = QueryOccupancy_Request;
  EXPECT_LT(most_bytes<Query>(Getter<Query, OccupancyBox>(&Query::boxes),
                              Getter<Query, OccupancyRay>(&Query::rays),
                              Getter<Query, Coordinates>(&Query::points)),
            most);
  // Numbers.
  EXPECT_LT(most_bytes<Voxels>(Getter<Voxels, float>(&Voxels::x)), 2 * sample_bytes);
}

TEST(HostileCount, LeavesSamplesThatHaveTheirElements) {
  tf2_msgs::msg::TFMessage sent, got;
  sent.transforms().resize(500);
  sent.transforms()[499].child_frame_id("lidar");
  // What was read before is neither in the way nor left behind.
  got.transforms().resize(700);
  SerializedSample bytes = to_bytes(type_support<tf2_msgs::msg::TFMessage>(), &sent, 0);
  ASSERT_TRUE(from_bytes(type_support<tf2_msgs::msg::TFMessage>(), bytes, &got));
  EXPECT_EQ(got, sent);
  got.transforms().clear();
  ASSERT_TRUE(from_bytes(type_support<tf2_msgs::msg::TFMessage>(), bytes, &got));
  EXPECT_EQ(got, sent);
}

TEST(HostileCount, OfAnAnnouncementOfNodesIsNotReadWhereItIsTooLarge) {
  rmw_dds_common::msg::ParticipantEntitiesInfo info;
  info.node_entities_info_seq().resize(1);
  info.node_entities_info_seq()[0].node_name("rviz2");
  SerializedSample small =
      to_bytes(type_support<rmw_dds_common::msg::ParticipantEntitiesInfo>(), &info, 0);
  EXPECT_EQ(ros_node_names(small), std::vector<std::string>{"/rviz2"});
  info.node_entities_info_seq()[0].node_name("rviz\x1b[2J");
  small = to_bytes(type_support<rmw_dds_common::msg::ParticipantEntitiesInfo>(), &info, 0);
  EXPECT_EQ(ros_node_names(small), std::vector<std::string>{"/rviz?[2J"});
  // 16 bytes make a node of half a kilobyte.
  info.node_entities_info_seq().resize(70'000);
  SerializedSample large =
      to_bytes(type_support<rmw_dds_common::msg::ParticipantEntitiesInfo>(), &info, 0);
  EXPECT_TRUE(ros_node_names(large).empty());
}

}  // namespace
}  // namespace stillmap::dds
