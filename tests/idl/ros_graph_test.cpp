#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "idl/dds/reader.hpp"
#include "idl/dds/ros_nodes.hpp"
#include "idl/dds/writer.hpp"
#include "rmw_dds_common.h"
#include "rmw_dds_common_iron.h"
#include "sensor_msgs.h"
#include "tests/idl/dds_fixture.hpp"

// ros_discovery_info while endpoints come and go.

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using rmw_dds_common::msg::ParticipantEntitiesInfo;
using sensor_msgs::msg::PointCloud2;

class RosGraphOfANode : public testing::Test {
 protected:
  static DdsOptions node_options() {
    DdsOptions options = loopback(false);
    options.node_name = "mapper";
    return options;
  }

  /// Takes announcements until one has so many readers and writers.
  bool announces(std::size_t readers, std::size_t writers) {
    while (announcements_.take(newest_, {}, discovery_timeout)) {
      const auto& node = newest_.node_entities_info_seq().at(0);
      if (node.reader_gid_seq().size() == readers && node.writer_gid_seq().size() == writers) {
        return true;
      }
    }
    return false;
  }

  Participant node_{node_options()};
  Participant watcher_{loopback(false)};
  Reader<ParticipantEntitiesInfo> announcements_{
      watcher_, "ros_discovery_info", {.transient_local = true, .depth = 1}};
  ParticipantEntitiesInfo newest_;
};

TEST_F(RosGraphOfANode, AnnouncesEndpointsAsTheyComeAndGo) {
  EXPECT_TRUE(announces(0, 0));
  {
    const Reader<PointCloud2> reader(node_, "rt/points", {});
    EXPECT_TRUE(announces(1, 0));
    const auto& gid = newest_.node_entities_info_seq()[0].reader_gid_seq()[0].data();
    const auto guid = reader.guid();
    EXPECT_TRUE(std::equal(gid.begin(), gid.begin() + 12, guid.guidPrefix.value));
    EXPECT_TRUE(std::equal(gid.begin() + 12, gid.begin() + 16, guid.entityId.value));
    EXPECT_TRUE(std::all_of(gid.begin() + 16, gid.end(), [](int byte) { return byte == 0; }));
    const Writer<PointCloud2> writer(node_, "rt/map", {});
    EXPECT_TRUE(announces(1, 1));
  }
  EXPECT_TRUE(announces(0, 0));
}

TEST(RosNodeNames, AreReadOfBothLayouts) {
  const auto check = []<typename Info>(Info info) {
    typename std::remove_cvref_t<decltype(info.node_entities_info_seq())>::value_type node;
    node.node_namespace("/");
    node.node_name("rviz2");
    node.reader_gid_seq().resize(3);
    info.node_entities_info_seq() = {node, node};
    info.node_entities_info_seq()[1].node_namespace("/robot");
    info.node_entities_info_seq()[1].writer_gid_seq().resize(2);
    const auto names = ros_node_names(to_bytes(type_support<Info>(), &info, 0));
    EXPECT_EQ(names, std::vector<std::string>({"/rviz2", "/robot/rviz2"}));
  };
  check(ParticipantEntitiesInfo());
  check(rmw_dds_common_iron::msg::ParticipantEntitiesInfo());
}

TEST(RosNodeNames, AreNoneInOtherBytes) {
  ParticipantEntitiesInfo info;
  info.node_entities_info_seq().resize(1);
  const SerializedSample good = to_bytes(type_support<ParticipantEntitiesInfo>(), &info, 0);
  for (std::size_t length = 0; length < good.size(); ++length) {
    const SerializedSample cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length));
    EXPECT_TRUE(ros_node_names(cut).empty()) << length;
  }
  EXPECT_TRUE(ros_node_names(SerializedSample(200, 0xFF)).empty());
}

TEST_F(RosGraphOfANode, TellsOtherNodesWhoIsWho) {
  DdsOptions options = node_options();
  options.node_name = "planner";
  // As Iron and later announce it.
  options.ros_gid_bytes = 16;
  const Participant planner(options);
  const auto is_known = [](const Participant& from, const std::string& name) {
    const auto peers = from.remote_participants();
    return std::ranges::any_of(peers, [&](const RemoteParticipant& peer) {
      return peer.ros_nodes == std::vector{name} && display_name(peer) == name;
    });
  };
  const auto deadline = std::chrono::steady_clock::now() + discovery_timeout;
  while (std::chrono::steady_clock::now() < deadline &&
         !(is_known(node_, "/planner") && is_known(planner, "/mapper"))) {
    std::this_thread::sleep_for(20ms);
  }
  EXPECT_TRUE(is_known(node_, "/planner"));
  EXPECT_TRUE(is_known(planner, "/mapper"));
}

TEST(DisplayName, PrefersNodesAndDoesNotTakeAnEnclaveForAName) {
  RemoteParticipant peer;
  EXPECT_EQ(display_name(peer), "a participant without a name");
  peer.name = "/";
  EXPECT_EQ(display_name(peer), "a participant without a name");
  peer.name = "driver";
  EXPECT_EQ(display_name(peer), "driver");
  peer.ros_nodes = {"/a", "/b", "/c", "/d", "/e"};
  EXPECT_EQ(display_name(peer), "/a, /b, /c and 2 more nodes");
}

}  // namespace
}  // namespace stillmap::dds
