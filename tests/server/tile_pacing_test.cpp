// Tiles over a network that carries less than the map changes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <functional>
#include <latch>
#include <map>
#include <optional>
#include <set>
#include <thread>

#include "idl/conversions/tile.hpp"
#include "idl/dds/reader.hpp"
#include "server/publishers/tile_publisher.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using stillmap_msgs::msg::MapTile;
using Clock = std::chrono::steady_clock;

constexpr std::size_t tile_voxels = 1000;

std::shared_ptr<const Tile> tile_of(TileId id, std::uint64_t revision,
                                    std::size_t voxels = tile_voxels) {
  Tile tile;
  tile.info = {.id = id, .revision = revision, .content_hash = revision, .bounds_map = {}};
  tile.voxels = PackedVoxels(id, {0.2, 20.0}, std::vector<Voxel>(voxels));
  tile.info.voxel_count = static_cast<std::uint32_t>(voxels);
  return std::make_shared<const Tile>(std::move(tile));
}

std::shared_ptr<const MapSnapshot> row_of_tiles(int count, std::uint64_t revision,
                                                std::size_t voxels = tile_voxels) {
  auto view = std::make_shared<MapSnapshot>();
  view->version = revision;
  view->map_id = 7;
  view->tile_size_m = 20.0;
  view->voxel_size_m = 0.2;
  for (int x = 0; x < count; ++x) view->tiles.set(tile_of({x, 0}, revision, voxels));
  return view;
}

/// The row, with tile 0 at another revision.
std::shared_ptr<const MapSnapshot> with_first_changed(const MapSnapshot& row,
                                                      std::uint64_t revision,
                                                      std::size_t voxels = tile_voxels) {
  auto view = std::make_shared<MapSnapshot>(row);
  view->version = revision;
  view->tiles.set(tile_of({0, 0}, revision, voxels));
  return view;
}

dds::DdsOptions slow_network() {
  dds::DdsOptions options = dds::loopback(false);
  options.large_message_bytes_per_s = 400'000;
  options.max_datagram_bytes = 1400;
  return options;
}

/// A reader of tiles that stops as by SIGSTOP with the first that it gets, and is still in the
/// domain: from then on it acknowledges nothing. A reader that only takes nothing does not do: what
/// it has no room for, it acknowledges too, within a tenth of a second.
class StoppedReader {
 public:
  explicit StoppedReader(const dds::DdsOptions& options)
      : participant_(options),
        reader_(participant_.make_reader(topics_.tiles.dds_name, dds::type_support<MapTile>(),
                                         topics_.tiles.reader, &stop_)) {}
  ~StoppedReader() { stop_.go_on.count_down(); }
  StoppedReader(const StoppedReader&) = delete;
  StoppedReader& operator=(const StoppedReader&) = delete;

  /// Whether the first has come; what sends it knows this reader then.
  [[nodiscard]] bool stops() const {
    return test::eventually([this] { return stop_.is_stopped.load(); });
  }

 private:
  /// Holds the thread that receives.
  struct Stop : eprosima::fastdds::dds::DataReaderListener {
    void on_data_available(eprosima::fastdds::dds::DataReader*) override {
      is_stopped = true;
      go_on.wait();
    }
    std::atomic<bool> is_stopped = false;
    std::latch go_on{1};
  };

  dds::Topics topics_ = dds::Topics::in("stillmap");
  Stop stop_;
  dds::Participant participant_;
  dds::Participant::ReaderHandle reader_;
};

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
  TileReader tiles_;
  TilePublisher publisher_{here_, topics_, tiles_, 2000.0};
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
  publisher_.publish(view, Eigen::Vector2d::Zero());
  EXPECT_GT(publisher_.waiting(), 25U);
  EXPECT_LT(publisher_.waiting(), 35U);
  while (publisher_.waiting() > 0 && Clock::now() - began < dds::discovery_timeout) {
    std::this_thread::sleep_for(50ms);
    publisher_.publish(view, Eigen::Vector2d::Zero());
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
  publisher_.publish(row, Eigen::Vector2d::Zero());
  while (publisher_.waiting() > 1 && Clock::now() - began < dds::discovery_timeout) {
    std::this_thread::sleep_for(50ms);
    publisher_.publish(with_first_changed(*row, ++revision), Eigen::Vector2d::Zero());
  }
  EXPECT_LT(Clock::now() - began, dds::discovery_timeout);
  expect_all_arrive(tiles);
}

// Its reader aborts where the rest of a keyed sample will not come.
TEST_F(TilePacing, ATileThatIsStillReceivedIsNotDisposed) {
  ASSERT_TRUE(reader_.events().wait_for_writer(dds::discovery_timeout));
  std::optional<StoppedReader> stopped(slow_network());
  const auto row = row_of_tiles(20, 1);
  publisher_.publish(row, Eigen::Vector2d::Zero());
  const std::size_t waiting = publisher_.waiting();
  ASSERT_TRUE(stopped->stops());
  auto without_first = std::make_shared<MapSnapshot>(*row_of_tiles(0, 2));
  for (int x = 1; x < 20; ++x) without_first->tiles.set(tile_of({x, 0}, 1));
  publisher_.publish(without_first, Eigen::Vector2d::Zero());
  EXPECT_EQ(publisher_.waiting(), waiting + 1);
  stopped.reset();
  const auto began = Clock::now();
  while (publisher_.waiting() > 0 && Clock::now() - began < dds::discovery_timeout) {
    std::this_thread::sleep_for(50ms);
    publisher_.publish(without_first, Eigen::Vector2d::Zero());
  }
  EXPECT_EQ(publisher_.waiting(), 0U);
  // The one that is gone was not taken before.
  expect_all_arrive(19);
}

TEST_F(TilePacing, WhatChangesWhileItWaitsIsSentAsItIsThen) {
  constexpr std::size_t tiles = 20;
  publisher_.publish(row_of_tiles(static_cast<int>(tiles), 1), Eigen::Vector2d::Zero());
  const std::size_t sent_at_once = tiles - publisher_.waiting();
  const auto newest = row_of_tiles(static_cast<int>(tiles), 2);
  const auto began = Clock::now();
  while (publisher_.waiting() > 0 && Clock::now() - began < dds::discovery_timeout) {
    publisher_.publish(newest, Eigen::Vector2d::Zero());
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

/// Beside a reader of tiles that has stopped.
class StoppedTileReader : public testing::Test {
 protected:
  /// 0: the network carries everything.
  explicit StoppedTileReader(std::uint32_t bytes_per_s = 0)
      : here_(options(bytes_per_s)), there_(options(bytes_per_s)) {}
  static dds::DdsOptions options(std::uint32_t bytes_per_s) {
    dds::DdsOptions options = dds::loopback(false);
    options.large_message_bytes_per_s = bytes_per_s;
    // So long the publisher waits for that reader.
    options.lease_s = static_cast<std::uint32_t>(dds::discovery_timeout.count());
    return options;
  }
  /// What the index says of tiles 0 and 1 of the row, as soon as `is_all`, or at last.
  std::map<std::int32_t, TileInfo> take(
      const std::function<bool(const std::map<std::int32_t, TileInfo>&)>& is_all) {
    stillmap_msgs::msg::TileInfo message;
    while (!is_all(entries_) && index_.take(message, {}, 5s)) {
      entries_[message.tile_x()] = wire::from_wire(message).value();
    }
    return entries_;
  }

  dds::Topics topics_ = dds::Topics::in("stillmap");
  dds::Participant here_;
  dds::Participant there_;
  TileReader tiles_;
  TilePublisher publisher_{here_, topics_, tiles_, 2000.0};
  StoppedReader stopped_{there_.options()};
  dds::Reader<stillmap_msgs::msg::TileInfo> index_{there_, topics_.tile_index.dds_name,
                                                   topics_.tile_index.reader};
  std::map<std::int32_t, TileInfo> entries_;
};

TEST_F(StoppedTileReader, HoldsUpNeitherEntriesNorRemovals) {
  ASSERT_TRUE(index_.events().wait_for_writer(dds::discovery_timeout));
  const auto row = row_of_tiles(3, 1);
  publisher_.publish(row, Eigen::Vector2d::Zero());
  ASSERT_EQ(publisher_.waiting(), 0U);
  ASSERT_EQ(take([](const auto& entries) { return entries.size() == 3; }).size(), 3U);
  ASSERT_TRUE(stopped_.stops());
  auto next = std::make_shared<MapSnapshot>(*with_first_changed(*row, 2));
  next->tiles.erase({1, 0});
  publisher_.publish(next, Eigen::Vector2d::Zero());
  EXPECT_EQ(publisher_.waiting(), 2U) << "voxels of one, disposal of the other";
  const auto entries = take(
      [](const auto& seen) { return seen.at(0).revision == 2U && seen.at(1).voxel_count == 0; });
  EXPECT_EQ(entries.at(0).revision, 2U);
  EXPECT_EQ(entries.at(1).voxel_count, 0U);
  // Each is said once, whatever still waits.
  publisher_.publish(next, Eigen::Vector2d::Zero());
  stillmap_msgs::msg::TileInfo message;
  EXPECT_FALSE(index_.take(message, {}, 300ms));
}

/// The same, over a network that carries little.
class StoppedTileReaderOfALimitedRate : public StoppedTileReader {
 protected:
  explicit StoppedTileReaderOfALimitedRate(std::uint32_t bytes_per_s = 400'000)
      : StoppedTileReader(bytes_per_s) {}
  void SetUp() override { ASSERT_TRUE(index_.events().wait_for_writer(dds::discovery_timeout)); }
  /// The tiles that the index says are of this revision or a later one, until they are so many.
  std::set<std::int32_t> take_since(std::uint64_t revision, std::size_t tiles,
                                    std::chrono::milliseconds patience) {
    stillmap_msgs::msg::TileInfo message;
    while (said_.size() < tiles && index_.take(message, {}, patience)) {
      if (message.state().revision() >= revision) said_.insert(message.tile_x());
    }
    return said_;
  }
  std::set<std::int32_t> said_;
};

TEST_F(StoppedTileReaderOfALimitedRate, EntriesTakeNoMoreOfItThanTheyAre) {
  publisher_.publish(row_of_tiles(6, 1), Eigen::Vector2d::Zero());
  ASSERT_EQ(publisher_.waiting(), 0U);
  ASSERT_TRUE(stopped_.stops());
  // Voxels of one of them would use up what is left of the second.
  publisher_.publish(row_of_tiles(40, 2), Eigen::Vector2d::Zero());
  EXPECT_EQ(publisher_.waiting(), 40U);
  EXPECT_EQ(take_since(2, 40, 2s).size(), 40U);
}

class StoppedTileReaderOfASlowNetwork : public StoppedTileReaderOfALimitedRate {
 protected:
  StoppedTileReaderOfASlowNetwork() : StoppedTileReaderOfALimitedRate(10'000) {}
};

TEST_F(StoppedTileReaderOfASlowNetwork, ATileThatKeepsChangingDoesNotKeepTheEntriesOfOthers) {
  // They use up the first second.
  constexpr int tiles = 29;
  constexpr std::size_t voxels = 1;
  publisher_.publish(row_of_tiles(tiles, 1, voxels), Eigen::Vector2d::Zero());
  ASSERT_EQ(publisher_.waiting(), 0U);
  ASSERT_TRUE(stopped_.stops());
  const auto row = row_of_tiles(tiles, 2, voxels);
  std::uint64_t revision = 2;
  const auto began = Clock::now();
  while (said_.size() < tiles && Clock::now() - began < 10s) {
    publisher_.publish(with_first_changed(*row, ++revision, voxels), Eigen::Vector2d::Zero());
    take_since(2, tiles, 10ms);
  }
  EXPECT_EQ(said_.size(), static_cast<std::size_t>(tiles));
}

/// Of a map much larger than its window.
class TileWindow : public testing::Test {
 protected:
  static constexpr int side_tiles = 60;
  static constexpr double window_m = 100.0;

  TileWindow() {
    std::vector<std::shared_ptr<const Tile>> tiles;
    for (int x = 0; x < side_tiles; ++x) {
      for (int y = 0; y < side_tiles; ++y) tiles.push_back(small_tile({x, y}, 1));
    }
    view_.version = 1;
    view_.map_id = 7;
    view_.tile_size_m = 20.0;
    view_.voxel_size_m = 0.2;
    view_.tiles = TileTable(std::move(tiles));
  }
  static std::shared_ptr<const Tile> small_tile(TileId id, std::uint64_t revision) {
    Tile tile;
    tile.info = {.id = id, .revision = revision, .content_hash = revision, .bounds_map = {}};
    tile.info.voxel_count = 1;
    tile.voxels = PackedVoxels(id, {0.2, 20.0}, std::vector<Voxel>(1));
    return std::make_shared<const Tile>(std::move(tile));
  }
  void change(TileId id) {
    ++view_.version;
    view_.tiles.set(small_tile(id, view_.version));
  }
  void publish(double robot_m) {
    publisher_.publish(std::make_shared<const MapSnapshot>(view_),
                       Eigen::Vector2d(robot_m, robot_m));
  }
  using Revisions = std::map<TileId, std::uint64_t>;
  /// What arrives until `is_all`, and what comes soon after that.
  Revisions take(dds::Reader<MapTile>& reader,
                 const std::function<bool(const Revisions&)>& is_all) {
    Revisions got;
    MapTile message;
    while (reader.take(message, {},
                       is_all(got) ? 300ms : std::chrono::milliseconds(dds::discovery_timeout))) {
      got[{message.tile_x(), message.tile_y()}] = message.state().revision();
    }
    return got;
  }

  MapSnapshot view_;
  dds::Topics topics_ = dds::Topics::in("stillmap");
  dds::Participant here_{dds::loopback(true)};
  dds::Participant there_{dds::loopback(true)};
  TileReader tiles_;
  TilePublisher publisher_{here_, topics_, tiles_, window_m};
};

TEST_F(TileWindow, LateJoinersGetTheTilesRoundTheRobotAndWhatChangedElsewhere) {
  publish(600.0);
  // 50 m to either side touch 6 rows of tiles: the edges belong to them.
  EXPECT_GE(publisher_.held(), 25U);
  EXPECT_LE(publisher_.held(), 49U);
  change({2, 2});
  publish(600.0);
  dds::Reader<MapTile> reader(there_, topics_.tiles.dds_name, topics_.tiles.reader);
  const auto got = take(
      reader, [&](const Revisions& revisions) { return revisions.size() >= publisher_.held(); });
  EXPECT_EQ(got.size(), publisher_.held());
  EXPECT_EQ(got.at({2, 2}), 2U);
  for (const auto& [id, revision] : got) {
    if (id == TileId{2, 2}) continue;
    EXPECT_NEAR(id.x, 30, 4);
    EXPECT_NEAR(id.y, 30, 4);
  }
}

TEST_F(TileWindow, WhatIsHeldIsBoundedHoweverFarTheRobotGoes) {
  std::size_t most = 0;
  for (double robot_m = 0.0; robot_m < 20.0 * side_tiles; robot_m += 10.0) {
    publish(robot_m);
    most = std::max(most, publisher_.held());
  }
  EXPECT_GT(most, 200U);
  EXPECT_LE(most, 49 * 2 + TilePublisher::max_far_tiles);
  for (int i = 0; i < 400; ++i) {
    change({i % side_tiles, 5 + i / side_tiles});
    publish(1000.0);
  }
  EXPECT_LE(publisher_.held(), 49 + 1 + TilePublisher::max_far_tiles);
}

TEST_F(TileWindow, ATileThatLeavesStaysWithThoseWhoHaveIt) {
  dds::Reader<MapTile> reader(there_, topics_.tiles.dds_name, topics_.tiles.reader);
  ASSERT_TRUE(reader.events().wait_for_writer(dds::discovery_timeout));
  publish(100.0);
  const auto has_come = [](const Revisions& revisions) { return revisions.contains({5, 5}); };
  EXPECT_TRUE(has_come(take(reader, has_come)));
  view_.tiles.erase({5, 5});
  change({5, 6});
  publish(100.0);
  const auto has_followed = [&](const Revisions& revisions) {
    const auto found = revisions.find({5, 6});
    return found != revisions.end() && found->second == view_.version;
  };
  const Revisions got = take(reader, has_followed);
  EXPECT_TRUE(has_followed(got));
  EXPECT_FALSE(has_come(got)) << "disposed: no sample with voxels";
}

}  // namespace
}  // namespace stillmap::server
