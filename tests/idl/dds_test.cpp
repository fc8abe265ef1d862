#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <set>
#include <thread>
#include <vector>

#include "idl/conversions/pose.hpp"
#include "idl/conversions/tile.hpp"
#include "idl/dds/dds_error.hpp"
#include "idl/dds/reader.hpp"
#include "idl/dds/transports.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "sensor_msgs.h"
#include "stillmap_msgs.h"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using sensor_msgs::msg::PointCloud2;

TileInfo tile_info(TileId id, std::uint64_t revision) {
  TileInfo info;
  info.id = id;
  info.revision = revision;
  return info;
}

class OverTransport : public testing::TestWithParam<bool> {
 protected:
  Participant here_{loopback(GetParam())};
  Participant there_{loopback(GetParam())};
};

TEST_P(OverTransport, CarriesLargeCloudsWhole) {
  const TopicQos qos{.depth = 10};
  Writer<PointCloud2> writer(here_, "rt/points", qos);
  Reader<PointCloud2> reader(there_, "rt/points", qos);
  ASSERT_TRUE(writer.readers().wait_for_any(discovery_timeout));
  for (std::uint32_t i = 1; i <= 5; ++i) {
    ASSERT_TRUE(writer.write(cloud_of(3'000'000, i)));
    PointCloud2 got;
    ASSERT_TRUE(reader.take(got, {}, discovery_timeout));
    EXPECT_EQ(got.width(), i);
    EXPECT_EQ(got.data().size(), 3'000'000U);
    EXPECT_EQ(got.data().back(), i);
  }
}

// Where two readers are found at once, Fast DDS may name the same one twice.
TEST_P(OverTransport, ReadersAreThoseOfTheWriterWhateverItsEventsSay) {
  Writer<PointCloud2> writer(here_, "rt/points", {});
  auto reader = std::make_unique<Reader<PointCloud2>>(there_, "rt/points", TopicQos{});
  ASSERT_TRUE(writer.readers().wait_for_any(discovery_timeout));
  auto& readers = const_cast<MatchedReaders&>(writer.readers());
  MatchedReaders::Guid stranger = writer.guid();
  stranger.entityId = 0x77U;
  readers.update(stranger, true);
  EXPECT_FALSE(readers.has(stranger));
  EXPECT_TRUE(readers.has(reader->guid()));
  readers.update(reader->guid(), false);
  EXPECT_TRUE(readers.has(reader->guid()));
  reader.reset();
  EXPECT_TRUE(test::eventually([&] { return readers.count() == 0; }, discovery_timeout));
}

TEST_P(OverTransport, FilteredReadersGetTheirTilesOnly) {
  const auto topic = Topics::in("stillmap").tile_index;
  const ContentFilter filter{.expression = "tile_x BETWEEN %0 AND %1 AND tile_y BETWEEN %2 AND %3",
                             .parameters = {"-2", "1", "-7", "-1"}};
  Writer<stillmap_msgs::msg::TileInfo> writer(here_, topic.dds_name, topic.writer);
  const auto write_all = [&](std::uint64_t revision) {
    for (std::int32_t x = -4; x <= 4; ++x) {
      for (std::int32_t y = -4; y <= 4; ++y) {
        ASSERT_TRUE(writer.write(wire::to_wire(tile_info({x, y}, revision), MapIdentity())));
      }
    }
  };
  const auto expect_region = [&](Reader<stillmap_msgs::msg::TileInfo>& reader,
                                 std::uint64_t revision) {
    std::set<TileId> got;
    stillmap_msgs::msg::TileInfo message;
    while (got.size() < 16 && reader.take(message, {}, discovery_timeout)) {
      EXPECT_EQ(message.state().revision(), revision);
      got.insert({message.tile_x(), message.tile_y()});
    }
    EXPECT_EQ(got.size(), 16U);
    for (const TileId id : got) {
      EXPECT_TRUE(id.x >= -2 && id.x <= 1 && id.y >= -4 && id.y <= -1) << id.x << " " << id.y;
    }
  };
  write_all(1);
  // Comes late, and gets what the writer kept; then what is new.
  Reader<stillmap_msgs::msg::TileInfo> reader(there_, topic.dds_name, topic.reader, filter);
  expect_region(reader, 1);
  write_all(2);
  expect_region(reader, 2);
}

// With the filters at work in the writer, Fast DDS 2.9 crashes here within a second.
TEST_P(OverTransport, OutlivesFilteredReadersThatComeAndGo) {
  const auto topic = Topics::in("stillmap").tile_index;
  const ContentFilter filter{.expression = "tile_x BETWEEN %0 AND %1", .parameters = {"-2", "1"}};
  Writer<stillmap_msgs::msg::TileInfo> writer(here_, topic.dds_name, topic.writer);
  std::jthread writing([&](const std::stop_token& stop) {
    for (std::uint64_t i = 0; !stop.stop_requested(); ++i) {
      const TileId id{static_cast<std::int32_t>(i % 8) - 4, 0};
      static_cast<void>(writer.write(wire::to_wire(tile_info(id, i), MapIdentity())));
      // Without a pause this thread holds the writer's lock nearly always, and on a busy machine no
      // reader is answered for longer than the test waits.
      std::this_thread::sleep_for(100us);
    }
  });
  stillmap_msgs::msg::TileInfo message;
  // A slow machine needs seconds for four.
  const auto end = std::chrono::steady_clock::now() + 40s;
  for (int i = 0; i < 40 && std::chrono::steady_clock::now() < end; ++i) {
    std::vector<std::unique_ptr<Reader<stillmap_msgs::msg::TileInfo>>> readers;
    for (int k = 0; k < 4; ++k) {
      readers.push_back(std::make_unique<Reader<stillmap_msgs::msg::TileInfo>>(
          there_, topic.dds_name, topic.reader, filter));
    }
    EXPECT_TRUE(readers.front()->take(message, {}, discovery_timeout));
  }
}

// As of /tf_static, where one publisher keeps what it wrote and another does not.
TEST_P(OverTransport, AWriterThatKeepsNothingCostsNothingOfOneThatDoes) {
  const TopicQos keeping{.transient_local = true, .depth = 10};
  Writer<PointCloud2> keeps(here_, "rt/kept", keeping);
  ASSERT_TRUE(keeps.write(cloud_of(10, 1)));
  Writer<PointCloud2> forgets(here_, "rt/kept", {.depth = 10});
  TopicQos both = keeping;
  both.accept_best_effort = true;
  Reader<PointCloud2> reader(there_, "rt/kept", both);
  PointCloud2 got;
  std::set<std::uint32_t> seen;
  ASSERT_TRUE(test::eventually(
      [&] {
        static_cast<void>(forgets.write(cloud_of(10, 2)));
        while (reader.take(got, {}, 10ms)) seen.insert(got.width());
        return seen.size() == 2;
      },
      discovery_timeout));
  EXPECT_EQ(reader.matched_writers(), 2);
}

TEST_P(OverTransport, RefusesFiltersThatDoNotFitTheType) {
  const auto topic = Topics::in("stillmap").tile_index;
  using FilteredReader = Reader<stillmap_msgs::msg::TileInfo>;
  for (const char* const expression : {"tile_q = 1", "tile_x BETWEEN", "tile_x = 'a'"}) {
    EXPECT_THROW(FilteredReader(here_, topic.dds_name, topic.reader, {expression, {}}), DdsError)
        << expression;
  }
}

TEST_P(OverTransport, LosesAndReordersNothingWhenEverySampleCounts) {
  const auto topic = points_topic("points", DeliveryMode::every, 4);
  Writer<PointCloud2> writer(here_, topic.dds_name, topic.writer);
  Reader<PointCloud2> reader(there_, topic.dds_name, topic.reader);
  ASSERT_TRUE(writer.readers().wait_for_any(discovery_timeout));
  constexpr std::uint32_t clouds = 40;
  const std::jthread sender([&](const std::stop_token& stop) {
    for (std::uint32_t i = 0; i < clouds; ++i) {
      while (!stop.stop_requested() && !writer.write(cloud_of(500'000, i))) {
      }
    }
  });
  for (std::uint32_t i = 0; i < clouds; ++i) {
    PointCloud2 got;
    ASSERT_TRUE(reader.take(got, {}, discovery_timeout)) << "after " << i << " clouds";
    ASSERT_EQ(got.width(), i);
    std::this_thread::sleep_for(20ms);
  }
}

TEST_P(OverTransport, GivesALateJoinerTheNewestOfEveryKey) {
  const auto topic = Topics::in("stillmap").tile_index;
  Writer<stillmap_msgs::msg::TileInfo> writer(here_, topic.dds_name, topic.writer);
  constexpr int tiles = 300;
  for (std::uint64_t revision = 1; revision <= 2; ++revision) {
    for (int x = 0; x < tiles; ++x) {
      ASSERT_TRUE(writer.write(wire::to_wire(tile_info({x, -x}, revision), {})));
    }
  }
  writer.dispose(wire::to_wire(tile_info({0, 0}, 0), {}));

  Reader<stillmap_msgs::msg::TileInfo> reader(there_, topic.dds_name, topic.reader);
  std::map<std::int32_t, std::uint64_t> revisions;
  stillmap_msgs::msg::TileInfo message;
  while (revisions.size() < tiles - 1 && reader.take(message, {}, discovery_timeout)) {
    revisions[message.tile_x()] = message.state().revision();
  }
  EXPECT_EQ(revisions.size(), static_cast<std::size_t>(tiles - 1));
  EXPECT_FALSE(revisions.contains(0));
  for (const auto& [x, revision] : revisions) EXPECT_EQ(revision, 2U) << "tile " << x;
}

INSTANTIATE_TEST_SUITE_P(Dds, OverTransport, testing::Values(false, true),
                         [](const auto& info) { return info.param ? "SharedMemory" : "Udp"; });

TEST(Reader, StopsWaitingWhenAsked) {
  Participant participant(loopback(false));
  Reader<PointCloud2> reader(participant, "rt/points", {});
  std::stop_source stop;
  const auto began = std::chrono::steady_clock::now();
  const std::jthread stopper([&] {
    std::this_thread::sleep_for(50ms);
    stop.request_stop();
  });
  PointCloud2 cloud;
  EXPECT_FALSE(reader.take(cloud, stop.get_token(), 60s));
  EXPECT_LT(std::chrono::steady_clock::now() - began, 10s);
}

TEST(Reader, TellsOfPublishersThatDoNotFit) {
  Participant participant(loopback(false));
  Reader<PointCloud2> reader(participant, "rt/points", {.reliable = true});
  Writer<PointCloud2> writer(participant, "rt/points", {.reliable = false});
  EXPECT_TRUE(test::eventually([&] { return reader.events().incompatible_writers() > 0; },
                               discovery_timeout));
  EXPECT_EQ(reader.events().incompatible_writers(), 1);
  EXPECT_EQ(reader.events().matched_writers(), 0);
}

TEST(Participant, NamesWhatCannotWork) {
  DdsOptions options = loopback(false);
  options.domain_id = 233;
  try {
    const Participant participant(options);
    FAIL() << "domain 233 was accepted";
  } catch (const DdsError& error) {
    EXPECT_NE(std::string(error.what()).find("233"), std::string::npos);
  }
}

TEST(Participant, RefusesOneTopicWithTwoTypes) {
  Participant participant(loopback(false));
  const Writer<PointCloud2> writer(participant, "rt/points", {});
  EXPECT_THROW(Reader<nav_msgs::msg::Path>(participant, "rt/points", {}), DdsError);
}

TEST(Participant, CanBeMadeAgainAfterAFailureHalfWay) {
  const auto fail = [] {
    Participant participant(loopback(true));
    const Writer<PointCloud2> writer(participant, "rt/points", {});
    const Writer<nav_msgs::msg::Path> wrong(participant, "rt/points", {});
  };
  for (int i = 0; i < 3; ++i) EXPECT_THROW(fail(), DdsError);
}

TEST(Transports, TellTheBufferThatTheKernelGrants) {
  EXPECT_GE(granted_socket_buffer_bytes(65536), 65536U);
  std::uint32_t limit = 0;
  ASSERT_TRUE(std::ifstream("/proc/sys/net/core/rmem_max") >> limit);
  EXPECT_EQ(granted_socket_buffer_bytes(2 * limit), limit);
}

}  // namespace
}  // namespace stillmap::dds
