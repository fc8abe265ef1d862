// Keyed samples in fragments over a network that loses some.
#include <fastdds/rtps/transport/test_UDPv4TransportDescriptor.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <map>

#include "idl/dds/qos.hpp"
#include "idl/dds/reader.hpp"
#include "idl/interface/topics.hpp"
#include "stillmap_msgs.h"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using eprosima::fastdds::dds::DomainParticipantQos;
using eprosima::fastdds::rtps::test_UDPv4TransportDescriptor;
using stillmap_msgs::msg::MapTile;

/// A process whose network loses every tenth fragment that it sends.
class LossySender {
 public:
  LossySender() {
    DomainParticipantQos qos = eprosima::fastdds::dds::PARTICIPANT_QOS_DEFAULT;
    qos.transport().use_builtin_transports = false;
    const auto lossy = std::make_shared<test_UDPv4TransportDescriptor>();
    lossy->maxMessageSize = 1400;
    lossy->interfaceWhiteList = {"127.0.0.1"};
    lossy->dropDataFragMessagesPercentage = 10;
    qos.transport().user_transports.push_back(lossy);
    participant_ = factory_->create_participant(static_cast<std::int32_t>(test_domain_id()), qos);
    auto type = type_support<MapTile>();
    type.register_type(participant_);
    auto* const topic = participant_->create_topic(topic_.dds_name, type.get_type_name(),
                                                   eprosima::fastdds::dds::TOPIC_QOS_DEFAULT);
    writer_ = participant_->create_publisher(eprosima::fastdds::dds::PUBLISHER_QOS_DEFAULT)
                  ->create_datawriter(topic, writer_qos(topic_.writer, {}));
  }
  ~LossySender() {
    participant_->delete_contained_entities();
    factory_->delete_participant(participant_);
  }
  LossySender(const LossySender&) = delete;
  LossySender& operator=(const LossySender&) = delete;

  void write(MapTile tile) { writer_->write(&tile); }
  [[nodiscard]] bool wait_until_all_arrived() {
    return writer_->wait_for_acknowledgments(to_duration(discovery_timeout)) ==
           eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK;
  }

 private:
  TopicSpec<MapTile> topic_ = Topics::in("stillmap").tiles;
  std::shared_ptr<eprosima::fastdds::dds::DomainParticipantFactory> factory_ =
      eprosima::fastdds::dds::DomainParticipantFactory::get_shared_instance();
  eprosima::fastdds::dds::DomainParticipant* participant_ = nullptr;
  eprosima::fastdds::dds::DataWriter* writer_ = nullptr;
};

TEST(FragmentLoss, TilesInFragmentsArriveWholeWhenFragmentsGetLost) {
  talk_over_transports();
  LossySender sender;
  DdsOptions options = loopback(false);
  Participant there(options);
  const auto topic = Topics::in("stillmap").tiles;
  Reader<MapTile> reader(there, topic.dds_name, topic.reader);
  ASSERT_TRUE(reader.events().wait_for_writer(discovery_timeout));
  constexpr std::int32_t tiles = 100;
  constexpr std::uint64_t revisions = 3;
  for (std::uint64_t revision = 1; revision <= revisions; ++revision) {
    for (std::int32_t x = 0; x < tiles; ++x) {
      MapTile tile;
      tile.tile_x(x);
      tile.state().revision(revision);
      tile.index_x().assign(10'000, static_cast<std::uint16_t>(x));
      sender.write(tile);
    }
    // As TilePublisher does: what is replaced on its way makes readers of Fast DDS 2.9 abort.
    ASSERT_TRUE(sender.wait_until_all_arrived());
  }
  std::map<std::int32_t, std::uint64_t> newest;
  const auto all_newest = [&] {
    return newest.size() == tiles &&
           std::ranges::all_of(newest, [](const auto& entry) { return entry.second == revisions; });
  };
  MapTile got;
  while (!all_newest() && reader.take(got, {}, discovery_timeout)) {
    EXPECT_EQ(got.index_x(),
              std::vector<std::uint16_t>(10'000, static_cast<std::uint16_t>(got.tile_x())));
    newest[got.tile_x()] = got.state().revision();
  }
  EXPECT_TRUE(all_newest());
}

}  // namespace
}  // namespace stillmap::dds
