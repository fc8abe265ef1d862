#include <gmock/gmock.h>

#include <map>

#include "core/map/query/map_query.hpp"
#include "core/map/query/region.hpp"
#include "core/map/tile.hpp"
#include "core/map/voxel_grid.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

using Positions = std::vector<std::array<float, 3>>;

/// A client's copy of a region: each tile's voxels.
using Copy = std::map<TileId, Positions>;

/// The whole answer, page by page, put into the client's copy.
MapQueryResult update(Copy& copy, const MapSnapshot& view, const TileHistory& history,
                      MapQuery query) {
  const MapQueryResult first = query_map(view, query, &history);
  MapQueryResult page = first;
  Positions all;
  for (;;) {
    EXPECT_EQ(page.status, QueryStatus::ok) << page.reason;
    for (const QueryVoxel& voxel : page.voxels) {
      all.push_back({voxel.position_map.x(), voxel.position_map.y(), voxel.position_map.z()});
    }
    if (page.continuation.empty()) break;
    query.continuation = page.continuation;
    page = query_map(view, query);
  }
  auto next = all.begin();
  for (const TileChange& tile : first.tiles) {
    copy.erase(tile.id);
    if (tile.voxel_count > 0) copy[tile.id] = {next, next + tile.voxel_count};
    next += tile.voxel_count;
  }
  EXPECT_EQ(next, all.end());
  return first;
}

/// A map that was driven through, and then lost tiles and part of one.
class ChangesQueryTest : public testing::Test {
 protected:
  ChangesQueryTest() : map_(test::street_map(4, 200)) {
    before_ = map_.view();
    history_ = history_from(*before_);
    for (int i = 20; i < 24; ++i) {
      map_.insert(test::street_scan(static_cast<std::uint32_t>(i), 200),
                  Eigen::Isometry3d(Eigen::Translation3d(3.0 * i, 0.0, 1.73)));
    }
    MapSnapshot after = *map_.view();
    after.version += 1;
    const VoxelGrid grid(after.voxel_size_m, after.tile_size_m);
    const auto& all = after.tiles.front()->voxels;
    std::vector<Voxel> half(all.begin(), all.end());
    half.resize(half.size() / 2);
    after.tiles.set(std::make_shared<const Tile>(
        make_tile(after.tiles.front()->info.id, after.version, std::move(half), grid)));
    gone_ = after.tiles[1]->info.id;
    after.tiles.erase(gone_);
    after_ = std::make_shared<const MapSnapshot>(std::move(after));
    history_ = history_with({before_, std::make_shared<const TileHistory>(history_)}, *after_);
  }

  [[nodiscard]] KnownVersion known() const { return {before_->map_id, before_->version}; }

  StaticMap map_;
  std::shared_ptr<const MapSnapshot> before_;
  std::shared_ptr<const MapSnapshot> after_;
  TileHistory history_;
  TileId gone_;
};

TEST_F(ChangesQueryTest, ChangesTurnAnOldAnswerIntoTheNewOne) {
  for (const Region& region :
       {Region(BoxRegion()), Region(SphereRegion{.centre_map = {30, 0, 0}, .radius_m = 40.0}),
        Region(CorridorRegion{
            .path_map = {{-60, -5}, {20, 0}, {80, 5}}, .half_width_m = 9.0, .heights = {}})}) {
    MapQuery query;
    query.region = region;
    query.max_bytes = 50'000;
    Copy copy;
    update(copy, *before_, history_from(*before_), query);
    Copy expected;
    update(expected, *after_, history_, query);
    EXPECT_NE(copy, expected);
    query.since = known();
    const MapQueryResult changes = update(copy, *after_, history_, query);
    EXPECT_EQ(copy, expected);
    EXPECT_EQ(changes.map_version, after_->version);
  }
}

TEST_F(ChangesQueryTest, TellsWhatAppearedChangedAndWent) {
  MapQuery query;
  query.since = known();
  query.max_bytes = 100'000'000;
  const MapQueryResult result = query_map(*after_, query, &history_);
  ASSERT_EQ(result.status, QueryStatus::ok) << result.reason;
  std::map<TileChangeKind, int> kinds;
  for (const TileChange& tile : result.tiles) {
    ++kinds[tile.kind];
    if (tile.kind == TileChangeKind::removed) {
      EXPECT_EQ(tile.id, gone_);
      EXPECT_EQ(tile.revision, after_->version);
      EXPECT_EQ(tile.voxel_count, 0U);
    }
  }
  EXPECT_GT(kinds[TileChangeKind::appeared], 0);
  EXPECT_GT(kinds[TileChangeKind::changed], 0);
  EXPECT_EQ(kinds[TileChangeKind::removed], 1);
}

TEST_F(ChangesQueryTest, NothingChangedIsAnEmptyAnswer) {
  MapQuery query;
  query.since = {after_->map_id, after_->version};
  const MapQueryResult result = query_map(*after_, query, &history_);
  EXPECT_EQ(result.status, QueryStatus::ok) << result.reason;
  EXPECT_TRUE(result.tiles.empty());
  EXPECT_TRUE(result.voxels.empty());
}

TEST_F(ChangesQueryTest, SaysWhenItMustBeAskedForEverything) {
  const auto expect_unknown = [&](const KnownVersion& since, const std::string& named) {
    MapQuery query;
    query.since = since;
    const MapQueryResult result = query_map(*after_, query, &history_);
    EXPECT_EQ(result.status, QueryStatus::changes_unknown);
    EXPECT_THAT(result.reason, HasSubstr(named));
    EXPECT_THAT(result.reason, HasSubstr("ask for everything"));
    EXPECT_TRUE(result.voxels.empty());
  };
  expect_unknown({after_->map_id + 1, 1}, "since_map_id is 1");
  expect_unknown({after_->map_id, after_->version + 1}, "since_version is");
  history_.known_since = known().version + 1;
  expect_unknown(known(), "changes are remembered since version");
  MapQuery query;
  query.since = known();
  EXPECT_EQ(query_map(*after_, query).status, QueryStatus::changes_unknown);
}

TEST_F(ChangesQueryTest, RefusesChangesOfLargerCells) {
  MapQuery query;
  query.since = known();
  query.resolution_m = 1.0;
  const MapQueryResult result = query_map(*after_, query, &history_);
  EXPECT_EQ(result.status, QueryStatus::invalid_request);
  EXPECT_THAT(result.reason, HasSubstr("resolution_m is 1; with since_version"));
}

TEST_F(ChangesQueryTest, APageOfAnotherSinceIsRefused) {
  MapQuery query;
  query.since = known();
  query.max_bytes = 1'000;
  query.continuation = query_map(*after_, query, &history_).continuation;
  ASSERT_FALSE(query.continuation.empty());
  query.since = std::nullopt;
  EXPECT_EQ(query_map(*after_, query).status, QueryStatus::invalid_request);
}

TEST_F(ChangesQueryTest, TilesOfTheFirstPageCountAllVoxels) {
  MapQuery query;
  query.region = SphereRegion{.centre_map = {4, 2, 1}, .radius_m = 20.0};
  query.max_bytes = 5'000;
  MapQueryResult page = query_map(*after_, query);
  const std::vector<TileChange> tiles = page.tiles;
  ASSERT_GT(tiles.size(), 1U);
  std::vector<Eigen::Vector3f> positions;
  for (;;) {
    for (const QueryVoxel& voxel : page.voxels) positions.push_back(voxel.position_map);
    if (page.continuation.empty()) break;
    query.continuation = page.continuation;
    page = query_map(*after_, query);
    EXPECT_TRUE(page.tiles.empty());
  }
  auto next = positions.begin();
  for (const TileChange& tile : tiles) {
    EXPECT_EQ(tile.kind, TileChangeKind::appeared);
    const Eigen::AlignedBox3d footprint = tile_footprint(tile.id, after_->tile_size_m);
    for (std::uint32_t i = 0; i < tile.voxel_count; ++i) {
      EXPECT_TRUE(footprint.contains((next++)->cast<double>()));
    }
  }
  EXPECT_EQ(next, positions.end());
}

}  // namespace
}  // namespace stillmap
