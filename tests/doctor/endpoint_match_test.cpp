#include "idl/dds/endpoint_match.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/doctor/make_endpoint.hpp"

namespace stillmap::cli {
namespace {

using namespace std::chrono_literals;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

dds::Endpoint end(bool is_writer) {
  return test::make_endpoint("rt/points", "sensor_msgs::msg::dds_::PointCloud2_", is_writer);
}

/// A writer and a reader that fit, to be spoiled.
class EndpointMatch : public testing::Test {
 protected:
  [[nodiscard]] std::vector<std::string> found() const {
    return dds::incompatible_policies(writer_, reader_);
  }
  dds::Endpoint writer_ = end(true);
  dds::Endpoint reader_ = end(false);
};

TEST_F(EndpointMatch, FindsNothingWhereNothingIs) {
  EXPECT_THAT(found(), IsEmpty());
  reader_.qos.reliable = false;
  writer_.qos.durability = dds::Durability::persistent;
  writer_.qos.deadline = 100ms;
  writer_.qos.liveliness_kind = 2;
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(EndpointMatch, NamesThePolicy) {
  writer_.qos.reliable = false;
  EXPECT_THAT(found(), ElementsAre("reliability: the writer offers best effort, the reader wants "
                                   "reliable"));
  reader_.qos.durability = dds::Durability::transient_local;
  EXPECT_THAT(found(), SizeIs(2));
  EXPECT_THAT(found().back(), HasSubstr("durability: the writer offers volatile"));
}

TEST_F(EndpointMatch, ComparesTypesAndKeys) {
  writer_.is_keyed = true;
  EXPECT_THAT(found(), ElementsAre(HasSubstr("keys")));
  writer_.type = "sensor_msgs::msg::dds_::LaserScan_";
  EXPECT_THAT(found(), ElementsAre(HasSubstr("LaserScan_")));
}

TEST_F(EndpointMatch, ComparesPromisesOfTime) {
  reader_.qos.deadline = 100ms;
  EXPECT_THAT(found(), ElementsAre("deadline: the writer offers none, the reader wants 100 ms"));
  writer_.qos.deadline = 200ms;
  EXPECT_THAT(found(), ElementsAre("deadline: the writer offers 200 ms, the reader wants 100 ms"));
  writer_.qos.deadline = 50ms;
  reader_.qos.liveliness_lease = 1s;
  reader_.qos.liveliness_kind = 1;
  EXPECT_THAT(found(), SizeIs(2));
}

TEST_F(EndpointMatch, ComparesPartitionsWithTheirPatterns) {
  reader_.qos.partitions = {"left", "car*"};
  EXPECT_THAT(found(), ElementsAre("partition: the writer is in '', the reader in 'left', 'car*'"));
  writer_.qos.partitions = {"car_7"};
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(EndpointMatch, ComparesOwnership) {
  reader_.qos.exclusive_ownership = true;
  EXPECT_THAT(found(), ElementsAre(HasSubstr("ownership: the writer offers shared")));
}

TEST_F(EndpointMatch, LooksAtEveryPairOfDifferentPeersOnce) {
  writer_.qos.reliable = false;
  dds::RemoteParticipant lidar, server, other;
  lidar.name = "lidar";
  lidar.endpoints = {writer_, reader_};
  server.name = "server";
  server.endpoints = {reader_};
  other.endpoints = {end(true), writer_};
  other.endpoints.back().topic = "rt/elsewhere";
  const std::vector everybody{lidar, server, other};
  const auto pairs = dds::mismatches(everybody).found;
  ASSERT_THAT(pairs, SizeIs(1));
  EXPECT_EQ(pairs[0].writer_participant->name, "lidar");
  EXPECT_EQ(pairs[0].reader_participant->name, "server");
}

TEST_F(EndpointMatch, IsContentWithOneOfTwoReaders) {
  writer_.qos.reliable = false;
  dds::RemoteParticipant lidar, server;
  lidar.endpoints = {writer_};
  server.endpoints = {reader_, reader_};
  EXPECT_THAT(dds::mismatches_of(server, {lidar}).found, SizeIs(1));
  server.endpoints[1].qos.reliable = false;
  EXPECT_THAT(dds::mismatches_of(server, {lidar}).found, IsEmpty());
}

TEST_F(EndpointMatch, TakesEndpointsThatAreAlikeForOne) {
  writer_.qos.reliable = false;
  dds::RemoteParticipant sensors, viewers, self;
  sensors.endpoints.assign(3000, writer_);
  viewers.endpoints.assign(3000, reader_);
  const auto found = dds::mismatches({sensors, viewers, self});
  EXPECT_THAT(found.found, SizeIs(1));
  EXPECT_EQ(found.left_out, 0U);
}

TEST_F(EndpointMatch, OfOneParticipantIsNoMatterOfOthersOnly) {
  writer_.qos.reliable = false;
  dds::RemoteParticipant sensors, viewers, self;
  sensors.endpoints = {writer_};
  viewers.endpoints = {reader_};
  EXPECT_THAT(dds::mismatches_of(self, {sensors, viewers}).found, IsEmpty());
  self.endpoints = {reader_};
  EXPECT_THAT(dds::mismatches_of(self, {sensors, viewers}).found, SizeIs(1));
}

TEST_F(EndpointMatch, NamesABoundedNumberAndCountsTheRest) {
  dds::RemoteParticipant sensors, self;
  self.endpoints = {reader_};
  for (std::size_t i = 0; i < dds::max_mismatches + 7; ++i) {
    writer_.type = "type_" + std::to_string(i);
    sensors.endpoints.push_back(writer_);
  }
  const auto found = dds::mismatches_of(self, {sensors});
  EXPECT_THAT(found.found, SizeIs(dds::max_mismatches));
  EXPECT_EQ(found.left_out, 7U);
}

}  // namespace
}  // namespace stillmap::cli
