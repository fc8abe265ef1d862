#include "core/map/query/map_query.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <tuple>

#include "core/map/query/region.hpp"
#include "tests/map/map_worlds.hpp"
#include "tests/numbers.hpp"

namespace stillmap {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

using test::infinity;
using test::nan;

BoxRegion box_region(const AlignedBox3d& box_map) {
  BoxRegion region;
  region.box_map = box_map;
  return region;
}

using Row = std::tuple<float, float, float, SemanticClass, std::uint32_t>;

Row row(const QueryVoxel& v) {
  return {v.position_map.x(), v.position_map.y(), v.position_map.z(), v.label, v.point_count};
}

/// Every voxel of the map looked at.
std::vector<Row> oracle(const MapSnapshot& view, const MapQuery& query) {
  const RegionShape region(query.region);
  std::vector<Row> rows;
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      const SemanticClass label = voxel.evidence.winner();
      const bool is_wanted = query.classes.none() || query.classes[static_cast<std::size_t>(label)];
      if (!is_wanted || !region.contains(voxel.mean_map.cast<double>())) continue;
      rows.push_back(row({voxel.mean_map, label, 0.0F, voxel.point_count}));
    }
  }
  return rows;
}

/// All pages, one after the other.
std::vector<Row> all_pages(const MapSnapshot& view, MapQuery query, int& pages) {
  std::vector<Row> rows;
  pages = 0;
  do {
    const MapQueryResult result = query_map(view, query);
    EXPECT_EQ(result.status, QueryStatus::ok) << result.reason;
    EXPECT_LE(result.voxels.size() * query_voxel_bytes, query.max_bytes);
    EXPECT_EQ(result.map_version, view.version);
    for (const QueryVoxel& voxel : result.voxels) rows.push_back(row(voxel));
    query.continuation = result.continuation;
    ++pages;
    if (query.continuation.empty()) {
      EXPECT_EQ(result.total_voxels, rows.size());
    }
  } while (!query.continuation.empty() && pages < 10'000);
  return rows;
}

class MapQueryTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { view_ = test::street_map(12, 300).view(); }
  static void TearDownTestSuite() { view_.reset(); }
  static const MapSnapshot& view() { return *view_; }

 private:
  static inline std::shared_ptr<const MapSnapshot> view_;
};

TEST_F(MapQueryTest, AgreesWithBruteForceOnRandomBoxesAndClasses) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> coordinate(-70.0, 70.0);
  for (int i = 0; i < 200; ++i) {
    AlignedBox3d box_map;
    for (int corner = 0; corner < 2; ++corner) {
      box_map.extend(Vector3d(coordinate(random), coordinate(random), coordinate(random) / 10.0));
    }
    MapQuery query;
    query.region = box_region(box_map);
    if (i % 3 == 0) query.classes = random();
    query.max_bytes = 10'000'000;
    int pages = 0;
    EXPECT_EQ(all_pages(view(), query, pages), oracle(view(), query)) << i;
  }
}

TEST_F(MapQueryTest, ABoxThatBeginsOrEndsWhereAVoxelLiesHasIt) {
  std::size_t asked = 0;
  for (const QueryVoxel& voxel : query_map(view(), MapQuery()).voxels) {
    if (asked++ % 7 != 0) continue;
    const Vector3d position_map = voxel.position_map.cast<double>();
    for (const double reach_m : {0.05, -0.05}) {
      AlignedBox3d box_map(position_map);
      box_map.extend(position_map + Vector3d::Constant(reach_m));
      MapQuery query;
      query.region = box_region(box_map);
      EXPECT_THAT(query_map(view(), query).voxels,
                  testing::Contains(testing::Field(&QueryVoxel::position_map, voxel.position_map)))
          << position_map.transpose() << ", " << reach_m;
    }
  }
  EXPECT_GT(asked, 2000U);
}

TEST_F(MapQueryTest, AgreesWithBruteForceOnEveryKindOfRegion) {
  const HeightRange heights{.min_m = -1.0, .max_m = 2.0};
  for (const Region& region :
       {Region(SphereRegion{.centre_map = {4, 2, 1}, .radius_m = 9.0}),
        Region(PolygonRegion{.corners_map = {{-9, -9}, {21, -6}, {25, 13}, {6, 1}, {-5, 14}},
        .heights = heights}),
        Region(CorridorRegion{
            .path_map = {{-20, -9}, {5, 0}, {22, 11}}, .half_width_m = 2.5, .heights = heights})}) {
    for (const bool some_classes : {false, true}) {
      MapQuery query;
      query.region = region;
      query.max_bytes = 30'000;
      if (some_classes) query.classes.set(static_cast<std::size_t>(SemanticClass::road));
      int pages = 0;
      const std::vector<Row> rows = all_pages(view(), query, pages);
      EXPECT_GT(rows.size(), 100U);
      EXPECT_EQ(rows, oracle(view(), query));
    }
  }
}

TEST_F(MapQueryTest, PagesTogetherAreTheWholeAnswer) {
  for (const std::uint32_t max_bytes : {7'777U, 20'000U, 1'000'000'000U}) {
    MapQuery query;
    query.max_bytes = max_bytes;
    query.classes.set(static_cast<std::size_t>(SemanticClass::building));
    int pages = 0;
    EXPECT_EQ(all_pages(view(), query, pages), oracle(view(), query));
    EXPECT_EQ(pages > 1, max_bytes < 1'000'000U);
  }
}

TEST_F(MapQueryTest, PageSizeMayChangeBetweenPages) {
  MapQuery query;
  query.max_bytes = 1000;
  const MapQueryResult first = query_map(view(), query);
  query.continuation = first.continuation;
  query.max_bytes = 1'000'000'000;
  const MapQueryResult rest = query_map(view(), query);
  EXPECT_EQ(first.voxels.size() + rest.voxels.size(), oracle(view(), MapQuery()).size());
  EXPECT_EQ(rest.total_voxels, first.total_voxels);
}

TEST_F(MapQueryTest, CoarseCellsAreWeightedMeansOfTheirVoxels) {
  struct Sum {
    Vector3d weighted = Vector3d::Zero();
    std::uint64_t points = 0;
    std::map<SemanticClass, double> evidence;
  };
  for (const double resolution_m : {0.5, 0.73, 35.0}) {
    std::map<std::tuple<int, int, int>, Sum> cells;
    for (const auto& tile : view().tiles) {
      for (const Voxel& voxel : tile->voxels) {
        const Vector3d mean = voxel.mean_map.cast<double>();
        const Vector3d cell = (mean / resolution_m).array().floor();
        Sum& sum = cells[{int(cell.x()), int(cell.y()), int(cell.z())}];
        sum.weighted += mean * voxel.point_count;
        sum.points += voxel.point_count;
        for (const auto& vote : voxel.evidence.votes()) sum.evidence[vote.label] += vote.weight;
      }
    }
    MapQuery query;
    query.resolution_m = resolution_m;
    query.max_bytes = 100'000'000;
    const MapQueryResult result = query_map(view(), query);
    ASSERT_EQ(result.voxels.size(), cells.size());
    auto expected = cells.begin();
    for (const QueryVoxel& voxel : result.voxels) {
      const Sum& sum = (expected++)->second;
      EXPECT_LT((voxel.position_map.cast<double>() - sum.weighted / sum.points).norm(), 1e-4);
      EXPECT_EQ(voxel.point_count, sum.points);
      for (const auto& [label, weight] : sum.evidence) {
        EXPECT_LE(weight, sum.evidence.at(voxel.label) * (1.0 + 1e-5));
      }
    }
    query.max_bytes = static_cast<std::uint32_t>(query_voxel_bytes * (cells.size() / 3 + 1));
    int pages = 0;
    EXPECT_EQ(all_pages(view(), query, pages).size(), cells.size());
    EXPECT_EQ(pages, 3);
  }
}

TEST_F(MapQueryTest, ResolutionThatCameAsFloatIsTheMapsOwn) {
  MapQuery query;
  query.max_bytes = 100'000'000;
  const std::size_t own = query_map(view(), query).voxels.size();
  query.resolution_m = 0.2F;
  EXPECT_EQ(query_map(view(), query).voxels.size(), own);
}

TEST_F(MapQueryTest, NothingThereIsAFineAnswer) {
  MapQuery query;
  query.region = box_region({Vector3d::Constant(5000.0), Vector3d::Constant(5001.0)});
  MapQueryResult result = query_map(view(), query);
  EXPECT_EQ(result.status, QueryStatus::ok);
  EXPECT_TRUE(result.voxels.empty());
  EXPECT_TRUE(result.continuation.empty());
  query.region = box_region({Vector3d::Constant(9e5), Vector3d::Constant(infinity)});
  EXPECT_EQ(query_map(view(), query).total_voxels, 0U);
  EXPECT_EQ(query_map(MapSnapshot{}, MapQuery()).status, QueryStatus::ok);
  query.resolution_m = 1.0;
  EXPECT_EQ(query_map(MapSnapshot{}, query).status, QueryStatus::ok);
}

TEST_F(MapQueryTest, RefusesWhatCannotBeAnsweredAndNamesIt) {
  const auto expect_refused = [](const MapQuery& query, const std::string& named) {
    const MapQueryResult result = query_map(view(), query);
    EXPECT_EQ(result.status, QueryStatus::invalid_request);
    EXPECT_THAT(result.reason, testing::HasSubstr(named));
    EXPECT_TRUE(result.voxels.empty());
  };
  MapQuery query;
  query.region = box_region(AlignedBox3d());
  expect_refused(query, "box x is from");
  query.region = SphereRegion{};
  expect_refused(query, "sphere radius_m is 0");
  for (const double resolution_m : {-1.0, 0.1, nan, infinity, -infinity}) {
    query = MapQuery();
    query.resolution_m = resolution_m;
    expect_refused(query, "resolution_m is");
  }
  query = MapQuery();
  query.max_bytes = query_voxel_bytes - 1;
  expect_refused(query, "max_bytes is 20; must be at least 21");
}

TEST_F(MapQueryTest, HugeResolutionGivesFewCells) {
  MapQuery query;
  query.resolution_m = 1e300;
  EXPECT_LE(query_map(view(), query).total_voxels, 8U);
}

TEST_F(MapQueryTest, ContinuationOfAnotherVersionOrMapIsStale) {
  MapQuery query;
  query.max_bytes = 1000;
  query.continuation = query_map(view(), query).continuation;
  const auto continued = continued_map(query.continuation);
  ASSERT_TRUE(continued);
  EXPECT_EQ(continued->map_id, view().map_id);
  EXPECT_EQ(continued->version, view().version);
  MapSnapshot later = view();
  ++later.version;
  MapQueryResult result = query_map(later, query);
  EXPECT_EQ(result.status, QueryStatus::stale_continuation);
  EXPECT_THAT(result.reason, testing::HasSubstr("ask again"));
  EXPECT_EQ(result.map_version, later.version);
  MapSnapshot other = view();
  ++other.map_id;
  EXPECT_EQ(query_map(other, query).status, QueryStatus::stale_continuation);
}

TEST_F(MapQueryTest, ContinuationOfAnotherQueryIsRefused) {
  MapQuery query;
  query.max_bytes = 1000;
  query.continuation = query_map(view(), query).continuation;
  query.region = SphereRegion{.centre_map = Vector3d::Zero(), .radius_m = 10.0};
  const MapQueryResult result = query_map(view(), query);
  EXPECT_EQ(result.status, QueryStatus::invalid_request);
  EXPECT_THAT(result.reason, testing::HasSubstr("another query"));
}

TEST_F(MapQueryTest, DamagedContinuationsAreRefused) {
  MapQuery query;
  query.max_bytes = 1000;
  const std::string token = query_map(view(), query).continuation;
  std::vector<std::string> damaged{"x", token + "0", std::string(token.size(), 'f'),
                                   std::string(1'000'000, '\0')};
  for (std::size_t i = 0; i < token.size(); ++i) {
    damaged.push_back(token.substr(0, i + 1 == token.size() ? i : i + 1));
    damaged.push_back(token);
    damaged.back()[i] = token[i] == '5' ? '6' : '5';
  }
  for (const std::string& continuation : damaged) {
    query.continuation = continuation;
    EXPECT_EQ(query_map(view(), query).status, QueryStatus::invalid_request) << continuation;
    EXPECT_FALSE(continued_map(continuation));
  }
}

}  // namespace
}  // namespace stillmap
