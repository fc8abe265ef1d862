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

}  // namespace
}  // namespace stillmap::dds
