#include <gtest/gtest.h>

#include "idl/dds/reader.hpp"
#include "idl/dds/serialized_sample.hpp"
#include "sensor_msgs.h"
#include "tests/idl/dds_fixture.hpp"

// Samples that are none of the topic's type, as a damaged or hostile process may send.

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using sensor_msgs::msg::PointCloud2;

SerializedSample cloud_bytes(std::uint32_t width) {
  PointCloud2 cloud;
  cloud.width(width);
  cloud.data().assign(100, 1);
  return to_bytes(type_support<PointCloud2>(), &cloud, 0);
}

std::vector<SerializedSample> hostile_clouds() {
  const SerializedSample good = cloud_bytes(1);
  std::vector<SerializedSample> all;
  for (std::size_t length = encapsulation_bytes; length < good.size(); length += 7) {
    all.emplace_back(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length));
  }
  for (std::size_t at = 0; at < good.size(); ++at) {
    all.push_back(good);
    all.back()[at] = 0xFF;
  }
  return all;
}

TEST(SerializedSampleTest, IsNoFormOfATypeThatIsReadInTheSameProcess) {
  Participant participant(loopback(false));
  const Reader<PointCloud2> reader(participant, "rt/points", {});
  const std::string type_name = type_support<PointCloud2>().get_type_name();
  EXPECT_THROW(SerializedSampleReader(participant, "rt/points", type_name, {}), DdsError);
  EXPECT_THROW(SerializedSampleReader(participant, "rt/other_points", type_name, {}), DdsError);
}

TEST(HostileSample, IsPassedOverByAReaderThatGoesOn) {
  Participant here(loopback(false));
  Participant there(loopback(false));
  const TopicQos qos{.depth = 2000};
  Reader<PointCloud2> reader(there, "rt/points", qos);
  SerializedSampleWriter writer(here, "rt/points", type_support<PointCloud2>().get_type_name(),
                                qos);
  ASSERT_TRUE(writer.readers().wait_for_any(discovery_timeout));
  for (const SerializedSample& bytes : hostile_clouds()) {
    eprosima::fastrtps::rtps::WriteParams params;
    ASSERT_TRUE(writer.write(bytes, params));
  }
  constexpr std::uint32_t last = 4711;
  eprosima::fastrtps::rtps::WriteParams params;
  ASSERT_TRUE(writer.write(cloud_bytes(last), params));
  PointCloud2 got;
  bool has_last = false;
  // Bytes that mean another valid cloud may come before.
  while (!has_last && reader.take(got, {}, discovery_timeout)) has_last = got.width() == last;
  EXPECT_TRUE(has_last);
}

TEST(HostileSample, IsToldOfWithItsWriterItsNumberAndWhatItIs) {
  Participant here(loopback(false));
  Participant there(loopback(false));
  Reader<PointCloud2> reader(there, "rt/points", {.depth = 10});
  SerializedSampleWriter writer(here, "rt/points", type_support<PointCloud2>().get_type_name(),
                                {.depth = 10});
  ASSERT_TRUE(writer.readers().wait_for_any(discovery_timeout));
  SerializedSample bytes = cloud_bytes(1);
  bytes[1] = 0x07;  // XCDR2
  eprosima::fastrtps::rtps::WriteParams unread, read;
  ASSERT_TRUE(writer.write(bytes, unread));
  ASSERT_TRUE(writer.write(cloud_bytes(2), read));
  PointCloud2 got;
  ASSERT_TRUE(reader.take(got, {}, discovery_timeout));
  EXPECT_EQ(got.width(), 2U);
  const std::vector<UnreadableSample> unreadable = reader.take_unreadable();
  ASSERT_EQ(unreadable.size(), 1U);
  EXPECT_EQ(unreadable[0].identity, unread.sample_identity());
  EXPECT_NE(unreadable[0].why.find("XCDR2"), std::string::npos);
  EXPECT_TRUE(reader.take_unreadable().empty());
}

TEST(HostileName, HasNothingThatATerminalObeysOrThatIsNoText) {
  DdsOptions options = loopback(false);
  options.participant_name = "lidar\x1b[2J\n\xFF";
  Participant there(options);
  const Participant here(loopback(false));
  const SerializedSampleWriter writer(there, "rt/a\nb", "type\x1b", {});
  const auto is_seen = [&] {
    const std::vector<RemoteParticipant> peers = here.remote_participants();
    return peers.size() == 1 && peers[0].name == "lidar?[2J??" && peers[0].endpoints.size() == 1 &&
           peers[0].endpoints[0].topic == "rt/a?b" && peers[0].endpoints[0].type == "type?";
  };
  EXPECT_TRUE(test::eventually(is_seen, discovery_timeout, 5ms));
}

}  // namespace
}  // namespace stillmap::dds
