#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <limits>
#include <thread>

#include "core/map/query/query_checks.hpp"
#include "core/map/query/region.hpp"
#include "tests/numbers.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

using test::nan;

BoxRegion box(const Eigen::Vector3d& min, const Eigen::Vector3d& max) {
  BoxRegion region;
  region.box_map.min() = min;
  region.box_map.max() = max;
  return region;
}

class QueryService : public testing::Test {
 protected:
  QueryService() : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    drive(publisher_, 0, 8);
    EXPECT_TRUE(wait_for_scans(client_, 8));
    // Publishes everything that was mapped first.
    (void)client_.save_map();
    EXPECT_GT(client_.status().voxel_count, 0U);
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
  ScanPublisher publisher_{setup_.publisher(true)};
};

TEST_F(QueryService, AnswersByRegionAndClass) {
  const MapQueryResult all = client_.get_whole_static_map({});
  ASSERT_EQ(all.status, QueryStatus::ok) << all.reason;
  EXPECT_GT(all.voxels.size(), 0U);
  EXPECT_EQ(all.voxels.size(), all.total_voxels);

  MapQuery poles;
  const BoxRegion near = box({0.0, -10.0, -5.0}, {30.0, 10.0, 5.0});
  poles.region = near;
  poles.classes.set(static_cast<std::size_t>(SemanticClass::pole));
  const MapQueryResult some = client_.get_whole_static_map(poles);
  ASSERT_EQ(some.status, QueryStatus::ok) << some.reason;
  EXPECT_GT(some.voxels.size(), 0U);
  EXPECT_LT(some.voxels.size(), all.voxels.size());
  for (const QueryVoxel& voxel : some.voxels) {
    EXPECT_EQ(voxel.label, SemanticClass::pole);
    EXPECT_TRUE(near.box_map.contains(voxel.position_map.cast<double>()));
  }
}

TEST_F(QueryService, KeepsPagesOfOneMapWhileTheMapChanges) {
  MapQuery query;
  query.max_bytes = 20'000;
  const MapQueryResult first = client_.get_static_map(query);
  ASSERT_FALSE(first.continuation.empty());
  std::size_t voxels = first.voxels.size();

  drive(publisher_, 8, 16);
  ASSERT_TRUE(eventually([&] { return client_.status().map_version > first.map_version; }));
  MapQueryResult page = first;
  while (!page.continuation.empty()) {
    query.continuation = page.continuation;
    page = client_.get_static_map(query);
    ASSERT_EQ(page.status, QueryStatus::ok) << page.reason;
    EXPECT_EQ(page.map_version, first.map_version);
    EXPECT_EQ(page.total_voxels, first.total_voxels);
    voxels += page.voxels.size();
  }
  EXPECT_EQ(voxels, first.total_voxels);
}

TEST_F(QueryService, AnswersEveryKindOfRegion) {
  const MapQueryResult all = client_.get_whole_static_map({});
  for (const Region& region :
       {Region(SphereRegion{.centre_map = {5, 0, 0}, .radius_m = 12.0}),
        Region(PolygonRegion{.corners_map = {{-10, -20}, {20, -20}, {5, 20}}, .heights = {-3, 3}}),
        Region(CorridorRegion{
            .path_map = {{-20, -10}, {0, 0}, {20, 10}}, .half_width_m = 3.0, .heights = {}})}) {
    MapQuery query;
    query.region = region;
    const MapQueryResult some = client_.get_whole_static_map(query);
    ASSERT_EQ(some.status, QueryStatus::ok) << some.reason;
    const RegionShape shape(region);
    const auto inside = std::ranges::count_if(all.voxels, [&](const QueryVoxel& voxel) {
      return shape.contains(voxel.position_map.cast<double>());
    });
    EXPECT_GT(inside, 0);
    EXPECT_EQ(some.voxels.size(), static_cast<std::size_t>(inside));
  }
}

TEST_F(QueryService, TellsWhatChangedSinceAVersion) {
  const MapQueryResult before = client_.get_whole_static_map({});
  drive(publisher_, 8, 20);
  ASSERT_TRUE(eventually([&] { return client_.status().map_version > before.map_version; }));
  MapQuery query;
  query.since = {.map_id = before.map_id, .version = before.map_version};
  const MapQueryResult changes = client_.get_whole_static_map(query);
  ASSERT_EQ(changes.status, QueryStatus::ok) << changes.reason;
  EXPECT_GT(changes.map_version, before.map_version);
  ASSERT_FALSE(changes.tiles.empty());
  std::size_t voxels = 0;
  for (const TileChange& tile : changes.tiles) {
    EXPECT_GT(tile.revision, before.map_version);
    EXPECT_NE(tile.kind, TileChangeKind::removed);
    voxels += tile.voxel_count;
  }
  EXPECT_EQ(voxels, changes.voxels.size());

  static_cast<void>(client_.reset());
  const MapQueryResult other = client_.get_static_map(query);
  EXPECT_EQ(other.status, QueryStatus::changes_unknown);
  EXPECT_THAT(other.reason, HasSubstr("ask for everything"));
}

struct HostileQuery {
  MapQuery query;
  std::string named;
  QueryStatus status = QueryStatus::invalid_request;
};

MapQuery of_region(const Region& region) {
  MapQuery query;
  query.region = region;
  return query;
}

std::vector<HostileQuery> hostile_queries() {
  std::vector<HostileQuery> all{
      {of_region(box({5, 0, 0}, {-5, 1, 1})), "box x is from 5 to -5"},
      {of_region(box({0, nan, 0}, {1, 1, 1})), "box y is from nan"},
      {of_region(box({-1e9, -1e9, -1e9}, {1e9, 1e9, 1e9})), "box x is from -1e+09 to 1e+09"},
      {of_region(SphereRegion{.centre_map = {nan, 0, 0}, .radius_m = 1.0}), "sphere centre"},
      {of_region(SphereRegion{}), "sphere radius_m is 0"},
      {of_region(PolygonRegion{.corners_map = {{0, 0}, {9, 9}, {9, 0}, {0, 9}}, .heights = {}}),
       "polygon edges 0 (from 0, 0 to 9, 9) and 2"},
      {of_region(PolygonRegion{}), "polygon has 0 corners"},
      {of_region(CorridorRegion{.path_map = {}, .half_width_m = 1.0, .heights = {}}),
       "corridor path has 0 points"},
      {of_region(CorridorRegion{.path_map = {{1, 1}}, .half_width_m = 1.0, .heights = {}}),
       "corridor path has 1 points"}};
  for (const double resolution_m : {-1.0, 1e-9, nan}) {
    all.push_back({{}, "resolution_m is"});
    all.back().query.resolution_m = resolution_m;
  }
  all.push_back({{}, "max_bytes is 0"});
  all.back().query.max_bytes = 0;
  all.push_back({{}, "continuation is damaged"});
  all.back().query.continuation = "no such page";
  return all;
}

/// A continuation of a state that the server does not have any more.
MapQuery stale_query(Client& client) {
  MapQuery query;
  query.max_bytes = 1000;
  auto token = from_token(client.get_static_map(query).continuation);
  EXPECT_TRUE(token);
  token->map_version += 1000;
  query.continuation = to_token(*token);
  return query;
}

TEST_F(QueryService, RefusesHostileQueriesWithTheirReasonAndGoesOn) {
  std::vector<HostileQuery> hostile = hostile_queries();
  hostile.push_back(
      {stale_query(client_), "ask again without continuation", QueryStatus::stale_continuation});
  std::printf("code  reason\n");
  for (const auto& [query, named, status] : hostile) {
    const MapQueryResult result = client_.get_static_map(query);
    std::printf("%4d  %s\n", static_cast<int>(result.status), result.reason.c_str());
    EXPECT_EQ(result.status, status) << named;
    EXPECT_THAT(result.reason, HasSubstr(named));
    EXPECT_TRUE(result.voxels.empty());
    EXPECT_EQ(client_.get_static_map({}).status, QueryStatus::ok);
  }
  MapQuery own_resolution;
  own_resolution.resolution_m = 0.0;
  EXPECT_EQ(client_.get_static_map(own_resolution).status, QueryStatus::ok);
  for (const BoxRegion& region : {box({5, 0, 0}, {-5, 1, 1}), box({0, nan, 0}, {1, 1, 1})}) {
    EXPECT_THROW(static_cast<void>(client_.get_tile_versions(region.box_map)), ServiceError);
  }
}

TEST_F(QueryService, RefusesTheContinuationOfAnotherMapOrQuery) {
  MapQuery query;
  query.max_bytes = 1000;
  query.continuation = client_.get_static_map(query).continuation;
  ASSERT_FALSE(query.continuation.empty());
  MapQuery other = query;
  other.region = SphereRegion{.centre_map = {0, 0, 0}, .radius_m = 5.0};
  EXPECT_EQ(client_.get_static_map(other).status, QueryStatus::invalid_request);
  EXPECT_EQ(client_.get_static_map(stale_query(client_)).status, QueryStatus::stale_continuation);
}

TEST_F(QueryService, FindsNothingWhereNothingIs) {
  MapQuery far;
  const BoxRegion region = box(Eigen::Vector3d::Constant(1e5), Eigen::Vector3d::Constant(9e5));
  far.region = region;
  const MapQueryResult result = client_.get_whole_static_map(far);
  EXPECT_EQ(result.status, QueryStatus::ok) << result.reason;
  EXPECT_TRUE(result.voxels.empty());
  EXPECT_TRUE(client_.get_tile_versions(region.box_map).tiles.empty());
}

TEST_F(QueryService, HandsOutTilesById) {
  const TileId nowhere{1'000'000, -1'000'000};
  TileVersions versions;
  TileSet set;
  // Until both answers show one state of the map.
  ASSERT_TRUE(eventually([&] {
    versions = client_.get_tile_versions();
    std::vector<TileId> ids = {nowhere};
    for (const TileInfo& info : versions.tiles) ids.push_back(info.id);
    set = client_.get_tiles(ids);
    return set.map.version == versions.map.version;
  }));
  ASSERT_FALSE(versions.tiles.empty());
  EXPECT_EQ(set.missing, std::vector<TileId>{nowhere});
  ASSERT_EQ(set.tiles.size(), versions.tiles.size());
  for (std::size_t i = 0; i < set.tiles.size(); ++i) {
    EXPECT_EQ(set.tiles[i].info.content_hash, versions.tiles[i].content_hash);
    EXPECT_EQ(set.tiles[i].voxels.size(), versions.tiles[i].voxel_count);
  }
  EXPECT_TRUE(client_.get_tiles({}).tiles.empty());
}

TEST_F(QueryService, SavesOnlyBesideItsOwnFile) {
  EXPECT_EQ(std::filesystem::path(client_.save_map()).filename(), "map.stillmap");
  EXPECT_TRUE(std::filesystem::exists(client_.save_map("copy.stillmap")));
  try {
    client_.save_map("../escaped.stillmap");
    FAIL() << "saved outside the folder";
  } catch (const ServiceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("plain name"));
  }
}

TEST(QueryWithoutServer, SaysWhatToCheck) {
  const ServiceSetup setup("latest");
  ClientOptions options = setup.client();
  options.request_timeout = std::chrono::milliseconds(200);
  Client client(options);
  try {
    static_cast<void>(client.status());
    FAIL() << "somebody answered";
  } catch (const ServiceTimeout& error) {
    EXPECT_THAT(error.what(), HasSubstr("stillmap/get_status"));
    EXPECT_THAT(error.what(), HasSubstr("domain " + std::to_string(options.dds.domain_id)));
    EXPECT_THAT(error.what(), HasSubstr("stillmap-server"));
  }
}

}  // namespace
}  // namespace stillmap::test
