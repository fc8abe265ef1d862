// Tiles over a network that carries less than the map changes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <thread>

#include "idl/dds/reader.hpp"
#include "server/publishers/tile_publisher.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using stillmap_msgs::msg::MapTile;
using Clock = std::chrono::steady_clock;

constexpr std::size_t tile_voxels = 1000;

std::shared_ptr<const Tile> tile_of(TileId id, std::uint64_t revision) {
  Tile tile;
  tile.info = {.id = id, .revision = revision, .content_hash = revision, .bounds_map = {}};
  tile.voxels.resize(tile_voxels);
  tile.info.voxel_count = tile_voxels;
  return std::make_shared<const Tile>(std::move(tile));
}

std::shared_ptr<const MapSnapshot> row_of_tiles(int count, std::uint64_t revision) {
  auto view = std::make_shared<MapSnapshot>();
  view->version = revision;
  view->map_id = 7;
  view->tile_size_m = 20.0;
  view->voxel_size_m = 0.2;
  for (int x = 0; x < count; ++x) view->tiles.push_back(tile_of({x, 0}, revision));
  return view;
}

/// The row, with tile 0 at another revision.
std::shared_ptr<const MapSnapshot> with_first_changed(const MapSnapshot& row,
                                                      std::uint64_t revision) {
  auto view = std::make_shared<MapSnapshot>(row);
  view->version = revision;
  view->tiles.front() = tile_of({0, 0}, revision);
  return view;
}

dds::DdsOptions slow_network() {
  dds::DdsOptions options = dds::loopback(false);
  options.large_message_bytes_per_s = 400'000;
  options.max_datagram_bytes = 1400;
  return options;
}

class TilePacing : public testing::Test {
 protected:
  void expect_all_arrive(std::size_t tiles) {
    std::map<std::int32_t, std::uint64_t> revisions;
    MapTile message;
    while (revisions.size() < tiles && reader_.take(message, {}, dds::discovery_timeout)) {
      revisions[message.tile_x()] = message.state().revision();
    }
    EXPECT_EQ(revisions.size(), tiles);
  }

  dds::Topics topics_ = dds::Topics::in("stillmap");
  dds::Participant here_{slow_network()};
  dds::Participant there_{slow_network()};
  TilePublisher publisher_{here_, topics_};
  dds::Reader<MapTile> reader_{there_, topics_.tiles.dds_name, topics_.tiles.reader};
};

TEST(TokenBucketOfNoRate, AllowsEverything) {
  TokenBucket bucket(0);
  bucket.refill(Clock::now());
  bucket.consume(1'000'000'000);
  EXPECT_TRUE(bucket.has_tokens());
}

TEST(TokenBucketOfARate, KeepsToItAndPaysItsDebts) {
  TokenBucket bucket(1000);
  Clock::time_point now{};
  bucket.refill(now);
  bucket.consume(3000);
  EXPECT_FALSE(bucket.has_tokens());
  bucket.refill(now += 1900ms);
  EXPECT_FALSE(bucket.has_tokens());
  bucket.refill(now += 200ms);
  EXPECT_TRUE(bucket.has_tokens());
}

TEST(TokenBucketOfARate, SavesUpNoMoreThanASecond) {
  TokenBucket bucket(1000);
  Clock::time_point now{};
  bucket.refill(now);
  bucket.refill(now += 3600s);
  bucket.consume(1001);
  EXPECT_FALSE(bucket.has_tokens());
}

TEST_F(TilePacing, ABurstIsSpreadAndArrivesWhole) {
  ASSERT_TRUE(reader_.events().wait_for_writer(dds::discovery_timeout));
  constexpr int tiles = 40;
  const auto view = row_of_tiles(tiles, 1);
  const auto began = Clock::now();
  publisher_.publish(view);
  EXPECT_GT(publisher_.waiting(), 25U);
  EXPECT_LT(publisher_.waiting(), 35U);
  while (publisher_.waiting() > 0 && Clock::now() - began < dds::discovery_timeout) {
    std::this_thread::sleep_for(50ms);
    publisher_.publish(view);
  }
  // 40 tiles of 27 KB at 200 KB/s, of which the first second's worth goes at once.
  EXPECT_GT(Clock::now() - began, 4s);
  expect_all_arrive(tiles);
}

TEST_F(TilePacing, ATileThatKeepsChangingDoesNotHoldUpTheOthers) {
  constexpr std::size_t tiles = 20;
  const auto row = row_of_tiles(static_cast<int>(tiles), 1);
  const auto began = Clock::now();
  std::uint64_t revision = 1;
  publisher_.publish(row);
  while (publisher_.waiting() > 1 && Clock::now() - began < dds::discovery_timeout) {
    std::this_thread::sleep_for(50ms);
    publisher_.publish(with_first_changed(*row, ++revision));
  }
  EXPECT_LT(Clock::now() - began, dds::discovery_timeout);
  expect_all_arrive(tiles);
}

TEST_F(TilePacing, WhatChangesWhileItWaitsIsSentAsItIsThen) {
  constexpr std::size_t tiles = 20;
  publisher_.publish(row_of_tiles(static_cast<int>(tiles), 1));
  const std::size_t sent_at_once = tiles - publisher_.waiting();
  const auto newest = row_of_tiles(static_cast<int>(tiles), 2);
  const auto began = Clock::now();
  while (publisher_.waiting() > 0 && Clock::now() - began < dds::discovery_timeout) {
    publisher_.publish(newest);
    std::this_thread::sleep_for(50ms);
  }
  std::map<std::int32_t, int> samples;
  MapTile message;
  // Those sent at once, which have waited least, come again last; then nothing comes.
  const auto last_x = static_cast<std::int32_t>(sent_at_once) - 1;
  bool has_last = false;
  while (reader_.take(message, {}, has_last ? 500ms : dds::discovery_timeout)) {
    ++samples[message.tile_x()];
    has_last |= message.tile_x() == last_x && message.state().revision() == 2U;
    if (message.tile_x() >= static_cast<std::int32_t>(sent_at_once)) {
      EXPECT_EQ(message.state().revision(), 2U);
    }
  }
  EXPECT_EQ(samples.size(), tiles);
  EXPECT_EQ(samples.rbegin()->second, 1);
}

}  // namespace
}  // namespace stillmap::server
