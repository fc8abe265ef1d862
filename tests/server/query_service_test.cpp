#include <gmock/gmock.h>

#include <limits>

#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

constexpr double infinite = std::numeric_limits<double>::infinity();

MapQuery whole_world() {
  MapQuery query;
  query.box_map = {Eigen::Vector3d::Constant(-infinite), Eigen::Vector3d::Constant(infinite)};
  return query;
}

class QueryService : public testing::Test {
 protected:
  QueryService() : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    drive(publisher_, 0, 8);
    EXPECT_TRUE(wait_for_scans(client_, 8));
    // The view that queries see follows within a moment.
    EXPECT_TRUE(eventually([&] { return client_.status().voxel_count > 0; }));
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
  ScanPublisher publisher_{setup_.publisher(true)};
};

TEST_F(QueryService, AnswersByRegionAndClass) {
  const MapQueryResult all = client_.get_whole_static_map(whole_world());
  ASSERT_EQ(all.status, QueryStatus::ok) << all.reason;
  EXPECT_GT(all.voxels.size(), 0U);
  EXPECT_EQ(all.voxels.size(), all.total_voxels);

  MapQuery poles = whole_world();
  poles.box_map = {Eigen::Vector3d(0.0, -10.0, -5.0), Eigen::Vector3d(30.0, 10.0, 5.0)};
  poles.classes.set(static_cast<std::size_t>(SemanticClass::pole));
  const MapQueryResult some = client_.get_whole_static_map(poles);
  ASSERT_EQ(some.status, QueryStatus::ok) << some.reason;
  EXPECT_GT(some.voxels.size(), 0U);
  EXPECT_LT(some.voxels.size(), all.voxels.size());
  for (const QueryVoxel& voxel : some.voxels) {
    EXPECT_EQ(voxel.label, SemanticClass::pole);
    EXPECT_TRUE(poles.box_map.contains(voxel.position_map.cast<double>()));
  }
}

TEST_F(QueryService, KeepsPagesOfOneMapWhileTheMapChanges) {
  MapQuery query = whole_world();
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

TEST_F(QueryService, RefusesAbsurdRegionsInWords) {
  MapQuery inside_out = whole_world();
  inside_out.box_map.min().x() = 5.0;
  inside_out.box_map.max().x() = -5.0;
  MapQuery nan = whole_world();
  nan.box_map.min().y() = std::numeric_limits<double>::quiet_NaN();
  MapQuery negative = whole_world();
  negative.resolution_m = -1.0;
  for (const MapQuery& query : {inside_out, nan, negative}) {
    const MapQueryResult result = client_.get_static_map(query);
    EXPECT_EQ(result.status, QueryStatus::invalid_request);
    EXPECT_FALSE(result.reason.empty());
    EXPECT_TRUE(result.voxels.empty());
  }
  MapQuery garbage = whole_world();
  garbage.continuation = "no such page";
  EXPECT_NE(client_.get_static_map(garbage).status, QueryStatus::ok);
  EXPECT_THROW(static_cast<void>(client_.get_tile_versions(inside_out.box_map)), ServiceError);
  EXPECT_THROW(static_cast<void>(client_.get_tile_versions(nan.box_map)), ServiceError);
  // And goes on.
  EXPECT_EQ(client_.get_static_map(whole_world()).status, QueryStatus::ok);
}

TEST_F(QueryService, FindsNothingWhereNothingIs) {
  MapQuery far = whole_world();
  far.box_map = {Eigen::Vector3d::Constant(1e7), Eigen::Vector3d::Constant(1e8)};
  const MapQueryResult result = client_.get_whole_static_map(far);
  EXPECT_EQ(result.status, QueryStatus::ok) << result.reason;
  EXPECT_TRUE(result.voxels.empty());
  EXPECT_TRUE(client_.get_tile_versions(far.box_map).tiles.empty());
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
