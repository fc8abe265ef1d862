#include <gtest/gtest.h>

#include <algorithm>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "idl/dds/qos.hpp"
#include "idl/dds/reader.hpp"
#include "idl/dds/ros_gids.hpp"
#include "idl/dds/ros_nodes.hpp"
#include "idl/dds/serialized_sample.hpp"
#include "idl/dds/type_hash.hpp"
#include "idl/dds/writer.hpp"
#include "rmw_dds_common.h"
#include "rmw_dds_common_iron.h"
#include "sensor_msgs.h"
#include "tests/idl/dds_fixture.hpp"

// ros_discovery_info while endpoints come and go, and as nodes of any ROS 2 read it.

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using namespace eprosima::fastdds::dds;
using HumbleInfo = rmw_dds_common::msg::ParticipantEntitiesInfo;
using IronInfo = rmw_dds_common_iron::msg::ParticipantEntitiesInfo;
using sensor_msgs::msg::PointCloud2;
using ReturnCode = eprosima::fastrtps::types::ReturnCode_t;

constexpr const char* info_type = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";
// As the nodes of Iron and later announce it.
constexpr const char* iron_user_data =
    "typehash=RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e;";

/// A ROS 2 node's reader of announcements, with the user data that it writes into its discovery.
class RosNode {
 public:
  explicit RosNode(const std::string& user_data) {
    talk_over_transports();
    participant_ = factory_->create_participant(static_cast<DomainId_t>(test_domain_id()),
                                                PARTICIPANT_QOS_DEFAULT);
    serialized_sample_type(info_type).register_type(participant_);
    Topic* const topic =
        participant_->create_topic(ros_discovery_topic, info_type, TOPIC_QOS_DEFAULT);
    DataReaderQos qos = reader_qos({.transient_local = true, .depth = 1}, {});
    qos.user_data().setValue({user_data.begin(), user_data.end()});
    reader_ =
        participant_->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic, qos);
  }
  ~RosNode() {
    participant_->delete_contained_entities();
    factory_->delete_participant(participant_);
  }
  RosNode(const RosNode&) = delete;
  RosNode& operator=(const RosNode&) = delete;

  /// Takes announcements until one reads as this type, with so many writers; returns how many did
  /// not, or nothing when none came in time.
  template <typename Info>
  std::optional<int> wait_for(std::size_t writers) {
    int unreadable = 0;
    SerializedSample bytes;
    SampleInfo sample;
    const auto has_come = [&] {
      while (reader_->take_next_sample(&bytes, &sample) == ReturnCode::RETCODE_OK) {
        Info info;
        if (!sample.valid_data) continue;
        if (!from_bytes(type_support<Info>(), bytes, &info) || !is_of_mapper(info)) {
          ++unreadable;
        } else if (info.node_entities_info_seq()[0].writer_gid_seq().size() == writers) {
          return true;
        }
      }
      return false;
    };
    if (!test::eventually(has_come, discovery_timeout, 5ms)) return std::nullopt;
    return unreadable;
  }

 private:
  template <typename Info>
  static bool is_of_mapper(const Info& info) {
    return info.node_entities_info_seq().size() == 1 &&
           std::string(info.node_entities_info_seq()[0].node_name().c_str()) == "mapper";
  }

  std::shared_ptr<DomainParticipantFactory> factory_ =
      DomainParticipantFactory::get_shared_instance();
  DomainParticipant* participant_ = nullptr;
  DataReader* reader_ = nullptr;
};

DdsOptions node_options() {
  DdsOptions options = loopback(false);
  options.interfaces.clear();
  options.node_name = "mapper";
  return options;
}

TEST(RosGraph, IsReadByNodesUpToHumble) {
  Participant node(node_options());
  const Writer<PointCloud2> writer(node, "rt/map", {});
  RosNode humble("");
  EXPECT_EQ(humble.wait_for<HumbleInfo>(1), 0) << "nothing that it cannot read";
}

TEST(RosGraph, IsReadByNodesFromIronOn) {
  RosNode iron(iron_user_data);
  Participant node(node_options());
  const Writer<PointCloud2> writer(node, "rt/map", {});
  EXPECT_EQ(iron.wait_for<IronInfo>(1), 0) << "nothing that it cannot read";
}

TEST(RosGraph, ChangesWithThePeers) {
  Participant node(node_options());
  const Writer<PointCloud2> writer(node, "rt/map", {});
  {
    RosNode humble("");
    EXPECT_EQ(humble.wait_for<HumbleInfo>(1), 0);
    RosNode iron(iron_user_data);
    EXPECT_NE(iron.wait_for<IronInfo>(1), std::nullopt);
  }
  RosNode jazzy(iron_user_data);
  EXPECT_EQ(jazzy.wait_for<IronInfo>(1), 0);
}

TEST(RosGids, AreToldByTheUserDataOfWhoReadsThem) {
  Endpoint endpoint;
  endpoint.topic = ros_discovery_topic;
  EXPECT_EQ(gids_read_by(endpoint), RosGids::of_24_bytes);
  endpoint.user_data = iron_user_data;
  EXPECT_EQ(gids_read_by(endpoint), RosGids::of_16_bytes);
  endpoint.user_data = any_gids_user_data;
  EXPECT_EQ(gids_read_by(endpoint), RosGids::any);
  endpoint.is_writer = true;
  EXPECT_EQ(gids_read_by(endpoint), std::nullopt);
  endpoint.is_writer = false;
  endpoint.topic = "rt/points";
  EXPECT_EQ(gids_read_by(endpoint), std::nullopt);
}

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
  // A reader of ours, which takes what comes.
  Reader<IronInfo> announcements_{
      watcher_, ros_discovery_topic, {.transient_local = true, .depth = 1}};
  IronInfo newest_;
};

TEST_F(RosGraphOfANode, AnnouncesEndpointsAsTheyComeAndGo) {
  EXPECT_TRUE(announces(0, 0));
  {
    const Reader<PointCloud2> reader(node_, "rt/points", {});
    EXPECT_TRUE(announces(1, 0));
    const auto& gid = newest_.node_entities_info_seq()[0].reader_gid_seq()[0].data();
    const auto guid = reader.guid();
    EXPECT_TRUE(std::equal(gid.begin(), gid.begin() + 12, guid.guidPrefix.value));
    EXPECT_TRUE(std::equal(gid.begin() + 12, gid.end(), guid.entityId.value));
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
  check(HumbleInfo());
  check(IronInfo());
}

TEST(RosNodeNames, AreNoneInOtherBytes) {
  HumbleInfo info;
  info.node_entities_info_seq().resize(1);
  const SerializedSample good = to_bytes(type_support<HumbleInfo>(), &info, 0);
  for (std::size_t length = 0; length < good.size(); ++length) {
    const SerializedSample cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length));
    EXPECT_TRUE(ros_node_names(cut).empty()) << length;
  }
  EXPECT_TRUE(ros_node_names(SerializedSample(200, 0xFF)).empty());
}

TEST_F(RosGraphOfANode, TellsOtherNodesWhoIsWho) {
  DdsOptions options = node_options();
  options.node_name = "planner";
  const Participant planner(options);
  const auto is_known = [](const Participant& from, const std::string& name) {
    const auto peers = from.remote_participants();
    return std::ranges::any_of(peers, [&](const RemoteParticipant& peer) {
      return peer.ros_nodes == std::vector{name} && display_name(peer) == name;
    });
  };
  EXPECT_TRUE(test::eventually([&] { return is_known(node_, "/planner"); }, discovery_timeout));
  EXPECT_TRUE(test::eventually([&] { return is_known(planner, "/mapper"); }, discovery_timeout));
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

TEST(TypeHash, IsAnnouncedByEveryEndpointOfARosType) {
  Participant node(loopback(false));
  Participant watcher(loopback(false));
  const Writer<PointCloud2> clouds(node, "rt/points", {});
  const Reader<PointCloud2> reader(node, "rt/points", {});
  const std::string wanted =
      "typehash=RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5;";
  std::vector<std::string> found;
  const auto finds_both = [&] {
    found.clear();
    for (const RemoteParticipant& peer : watcher.remote_participants()) {
      for (const Endpoint& endpoint : peer.endpoints) found.push_back(endpoint.user_data);
    }
    return found.size() >= 2;
  };
  EXPECT_TRUE(test::eventually(finds_both, discovery_timeout));
  EXPECT_EQ(found, (std::vector<std::string>{wanted, wanted}));
}

TEST(TypeHash, IsReadFromAnyUserData) {
  const std::string hash(type_hash("nav_msgs::msg::dds_::Odometry_"));
  EXPECT_EQ(hash, "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0");
  EXPECT_EQ(type_hash_in("typehash=" + hash + ";"), hash);
  EXPECT_EQ(type_hash_in("a=b;;typehash=" + hash), hash);
  EXPECT_EQ(type_hash_in("typehash=" + hash + "0;"), "");
  EXPECT_EQ(type_hash_in("typehash=RIHS02_" + hash.substr(7)), "");
  EXPECT_EQ(type_hash_in("mytypehash=" + hash + ";"), "");
  EXPECT_EQ(type_hash_in(std::string(300, '\xff')), "");
  EXPECT_EQ(type_hash_in(""), "");
  EXPECT_EQ(type_hash("a_msgs::msg::dds_::Unknown_"), "");
  EXPECT_EQ(type_hash_user_data("a_msgs::msg::dds_::Unknown_"), "");
}

}  // namespace
}  // namespace stillmap::dds
