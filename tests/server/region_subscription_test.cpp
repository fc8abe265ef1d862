#include <gmock/gmock.h>
#include <signal.h>

#include <map>
#include <mutex>
#include <optional>

#include "core/map/query/region.hpp"
#include "core/map/voxel_grid.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

/// A corner of the room: of its tiles, one or two are near.
const CorridorRegion corner{
    .path_map = {{-24.0, -19.5}, {-21.0, -1.0}}, .half_width_m = 0.5, .heights = {}};

/// What a subscriber holds: its copy of the region.
class RegionCopy {
 public:
  void add(const RegionUpdate& update) {
    const std::scoped_lock lock(mutex_);
    for (const Tile& tile : update.appeared) {
      EXPECT_TRUE(hashes_.emplace(tile.info.id, tile.info.content_hash).second);
      seen_.insert_or_assign(tile.info.id, true);
    }
    for (const Tile& tile : update.changed) {
      EXPECT_TRUE(hashes_.contains(tile.info.id));
      hashes_[tile.info.id] = tile.info.content_hash;
    }
    for (const TileId id : update.removed) EXPECT_EQ(hashes_.erase(id), 1U);
    map_id_ = update.map.map_id;
  }
  [[nodiscard]] std::map<TileId, std::uint64_t> hashes() const {
    const std::scoped_lock lock(mutex_);
    return hashes_;
  }
  /// All tiles that ever came.
  [[nodiscard]] std::map<TileId, bool> seen() const {
    const std::scoped_lock lock(mutex_);
    return seen_;
  }
  [[nodiscard]] std::uint64_t map_id() const {
    const std::scoped_lock lock(mutex_);
    return map_id_;
  }

 private:
  mutable std::mutex mutex_;
  std::map<TileId, std::uint64_t> hashes_;
  std::map<TileId, bool> seen_;
  std::uint64_t map_id_ = 0;
};

class RegionSubscription : public testing::Test {
 protected:
  RegionSubscription() : setup_("every"), client_(setup_.client()) {
    server_.emplace(setup_.server_arguments());
    client_.wait_for_server(patience);
  }

  /// Ends the server and starts another one with an empty map, its file with these sections, too.
  void restart(const std::string& yaml) {
    server_->send(SIGTERM);
    ASSERT_EQ(server_->wait_for_exit(patience), 0);
    setup_.add(yaml);
    std::vector<std::string> arguments = setup_.server_arguments();
    arguments.insert(arguments.end(), {"--map-file", (folder_ / "other.stillmap").string()});
    server_.emplace(arguments);
    client_.wait_for_server(patience);
  }

  /// What the server has of the region, and how many tiles it has elsewhere.
  [[nodiscard]] std::pair<std::map<TileId, std::uint64_t>, std::size_t> served() {
    const TileVersions versions = client_.get_tile_versions();
    std::map<TileId, std::uint64_t> inside;
    for (const TileInfo& info : versions.tiles) {
      if (shape_.may_intersect(tile_footprint(info.id, versions.map.tile_size_m))) {
        inside[info.id] = info.content_hash;
      }
    }
    return {inside, versions.tiles.size() - inside.size()};
  }

  void expect_only_the_region(const RegionCopy& copy) {
    ASSERT_TRUE(eventually([&] {
      const auto inside = served().first;
      return !inside.empty() && copy.hashes() == inside;
    }));
    const auto [inside, outside] = served();
    EXPECT_GT(outside, 1U);
    for (const auto& [id, seen] : copy.seen()) {
      EXPECT_TRUE(inside.contains(id)) << id.x << " " << id.y;
    }
  }

  ServiceSetup setup_;
  ScratchFolder folder_;
  std::optional<ServerProcess> server_;
  Client client_;
  ScanPublisher publisher_{setup_.publisher(true)};
  RegionShape shape_{Region(corner)};
};

TEST_F(RegionSubscription, FollowsItsRegionAndReceivesNothingElse) {
  RegionCopy copy;
  const auto subscription =
      client_.subscribe_region(corner, [&](const RegionUpdate& update) { copy.add(update); });
  drive(publisher_, 0, 6);
  expect_only_the_region(copy);
  drive(publisher_, 6, 12);
  ASSERT_TRUE(wait_for_scans(client_, 12));
  expect_only_the_region(copy);
}

TEST_F(RegionSubscription, ComesLateAndSeesAResetTakeItsTiles) {
  drive(publisher_, 0, 6);
  ASSERT_TRUE(wait_for_scans(client_, 6));
  RegionCopy copy;
  Client late(setup_.client());
  const auto subscription =
      late.subscribe_region(corner, [&](const RegionUpdate& update) { copy.add(update); });
  expect_only_the_region(copy);
  const std::uint64_t new_map = client_.reset().map_id;
  EXPECT_TRUE(eventually([&] { return copy.hashes().empty() && copy.map_id() == new_map; }));
  drive(publisher_, 0, 6);
  ASSERT_TRUE(wait_for_scans(client_, 12));
  expect_only_the_region(copy);
}

TEST_F(RegionSubscription, LosesItsTilesWhereAServerBeginsAnotherMap) {
  drive(publisher_, 0, 6);
  ASSERT_TRUE(wait_for_scans(client_, 6));
  RegionCopy copy;
  const auto subscription =
      client_.subscribe_region(corner, [&](const RegionUpdate& update) { copy.add(update); });
  expect_only_the_region(copy);
  // Until a scan comes, the new process has no tile to speak of.
  restart("static_map: {tile_size_m: 10}\n");
  EXPECT_TRUE(eventually([&] { return copy.hashes().empty(); }));
  drive(publisher_, 0, 6);
  ASSERT_TRUE(wait_for_scans(client_, 6));
  EXPECT_EQ(client_.get_tile_versions().map.tile_size_m, 10.0);
  EXPECT_TRUE(eventually([&] { return copy.hashes() == served().first; }));
  // In tiles of 20 m, x is -2.
  EXPECT_TRUE(copy.hashes().contains({-3, -1}));
}

TEST_F(RegionSubscription, RefusesARegionWithFaults) {
  const auto ignore = [](const RegionUpdate&) {};
  EXPECT_THROW(static_cast<void>(client_.subscribe_region(SphereRegion{}, ignore)),
               std::invalid_argument);
}

}  // namespace
}  // namespace stillmap::test
