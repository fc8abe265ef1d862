#include <gtest/gtest.h>

#include <limits>

#include "idl/conversions/map_query.hpp"

namespace stillmap::wire {
namespace {

TEST(QueryConversion, KeepsTheQuery) {
  MapQuery query;
  query.region = SphereRegion{.centre_map = {1.0, 2.0, 3.0}, .radius_m = 4.0};
  query.classes.set(0);
  query.classes.set(19);
  query.since = {.map_id = 77, .version = 0};
  query.resolution_m = 0.4;
  query.max_bytes = 1234;
  query.continuation = "where the last page ended";
  const QueryFromRequest back = from_request(to_request(query));
  ASSERT_TRUE(back.query) << back.fault;
  const auto& sphere = std::get<SphereRegion>(back.query->region);
  EXPECT_EQ(sphere.centre_map, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(sphere.radius_m, 4.0);
  ASSERT_TRUE(back.query->since);
  EXPECT_EQ(back.query->since->map_id, 77U);
  EXPECT_EQ(back.query->since->version, 0U);
  EXPECT_EQ(back.query->classes, query.classes);
  EXPECT_EQ(back.query->resolution_m, query.resolution_m);
  EXPECT_EQ(back.query->max_bytes, query.max_bytes);
  EXPECT_EQ(back.query->continuation, query.continuation);
}

TEST(QueryConversion, WithoutAKnownVersionAsksForEverything) {
  EXPECT_FALSE(from_request(to_request(MapQuery{})).query->since);
}

TEST(QueryConversion, RefusesUnknownClassesAndVersions) {
  auto request = to_request(MapQuery{});
  request.classes({3, 20});
  EXPECT_NE(from_request(request).fault.find("20"), std::string::npos);
  request = to_request(MapQuery{});
  request.format_version(9);
  EXPECT_NE(from_request(request).fault.find("format_version is 9"), std::string::npos);
}

TEST(QueryConversion, KeepsTheResult) {
  MapQueryResult result;
  result.status = QueryStatus::stale_continuation;
  result.reason = "too old";
  result.map_version = 5;
  result.map_id = 6;
  result.total_voxels = 70;
  result.continuation = "next";
  result.voxels = {{.position_map = {1.0F, 2.0F, 3.0F},
                    .label = SemanticClass::pole,
                    .confidence = 0.5F,
                    .point_count = 9}};
  result.tiles = {
      {.id = {-3, 4}, .kind = TileChangeKind::changed, .revision = 8, .voxel_count = 1},
      {.id = {5, -6}, .kind = TileChangeKind::removed, .revision = 7, .voxel_count = 0}};
  const auto back = from_response(to_response(result));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->status, result.status);
  EXPECT_EQ(back->reason, "too old");
  EXPECT_EQ(back->map_version, 5U);
  EXPECT_EQ(back->map_id, 6U);
  EXPECT_EQ(back->total_voxels, 70U);
  EXPECT_EQ(back->continuation, "next");
  EXPECT_EQ(back->tiles, result.tiles);
  ASSERT_EQ(back->voxels.size(), 1U);
  EXPECT_EQ(back->voxels[0].position_map, result.voxels[0].position_map);
  EXPECT_EQ(back->voxels[0].label, SemanticClass::pole);
  EXPECT_EQ(back->voxels[0].confidence, 0.5F);
  EXPECT_EQ(back->voxels[0].point_count, 9U);
}

TEST(QueryConversion, RefusesCodesThatDoNotExist) {
  MapQueryResult result;
  result.tiles.resize(1);
  auto response = to_response(result);
  response.tiles()[0].change(3);
  EXPECT_FALSE(from_response(response));
  response = to_response({});
  response.status().code(5);
  EXPECT_FALSE(from_response(response));
}

TEST(QueryConversion, RefusesArraysThatDoNotFit) {
  MapQueryResult result;
  result.voxels.resize(2);
  auto response = to_response(result);
  response.voxels().y().pop_back();
  EXPECT_FALSE(from_response(response));
}

}  // namespace
}  // namespace stillmap::wire
