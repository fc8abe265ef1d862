#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <mutex>

#include "core/traversability/traversability_query.hpp"
#include "tests/numbers.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

using test::nan;

TraversabilityQuery query_of(const Region& region, const std::string& profile = "car") {
  TraversabilityQuery query;
  query.profile = profile;
  query.region = region;
  return query;
}

PathQuery path_of(const std::string& profile, const std::vector<Eigen::Vector2d>& positions_map) {
  return {.profile = profile, .positions_map = positions_map, .headings_rad = {}};
}

/// A server that has mapped a hall with pillars and keeps the areas of two robots.
class TraversabilityService : public testing::Test {
 protected:
  /// Whether the server has the areas of the whole map. Before, on a busy machine, it computes
  /// those of the region that is asked for, and knows of no others.
  [[nodiscard]] bool is_kept() {
    const SphereRegion elsewhere{.centre_map = {5e5, 0, 0}, .radius_m = 3};
    return client_.get_traversable_area(query_of(elsewhere)).grid.reason !=
           TraversabilityView::nothing_known;
  }
  TraversabilityService()
      : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    drive(publisher_, 0, 12);
    EXPECT_TRUE(wait_for_scans(client_, 12));
    EXPECT_TRUE(eventually([&] {
      const auto answer = client_.get_traversable_area(query_of(BoxRegion{}));
      // Version 0 is the map before it is published for the first time.
      return answer.grid.status == TraversabilityStatus::ok && answer.grid.map_version > 0 &&
             answer.grid.map_version == client_.status().map_version && is_kept();
    }));
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
  ScanPublisher publisher_{setup_.publisher(true)};
};

TEST_F(TraversabilityService, TellsWhereEachRobotCanGo) {
  for (const std::string robot : {"car", "delivery_robot"}) {
    TraversabilityQuery query = query_of(BoxRegion{}, robot);
    query.include_outlines = true;
    const TraversabilityAnswer answer = client_.get_traversable_area(query);
    ASSERT_EQ(answer.grid.status, TraversabilityStatus::ok) << answer.grid.reason;
    const TraversabilitySummary summary = summarize(answer, query.region);
    EXPECT_GT(summary.free, 100U) << robot;
    EXPECT_GT(summary.lethal.at(static_cast<std::size_t>(BlockReason::obstacle)), 10U);
    EXPECT_GT(summary.lethal.at(static_cast<std::size_t>(BlockReason::inscribed)), 10U);
    EXPECT_FALSE(answer.outlines.empty());
    EXPECT_EQ(answer.map_id, client_.status().map_id);
  }
}

TEST_F(TraversabilityService, AnswersEveryKindOfRegion) {
  const TraversabilityAnswer all = client_.get_traversable_area(query_of(BoxRegion{}));
  const TraversabilityView whole = view_of_answer(all, RobotProfile{});
  for (const Region& region :
       {Region(SphereRegion{.centre_map = {5, 0, 0}, .radius_m = 6.0}),
        Region(PolygonRegion{.corners_map = {{-5, -9}, {14, -9}, {5, 9}}, .heights = {}}),
        Region(CorridorRegion{
            .path_map = {{-9, -5}, {0, 0}, {9, 5}}, .half_width_m = 3.0, .heights = {}})}) {
    const TraversabilityAnswer answer = client_.get_traversable_area(query_of(region));
    ASSERT_EQ(answer.grid.status, TraversabilityStatus::ok) << answer.grid.reason;
    EXPECT_GT(answer.grid.data.size(), 100U);
    EXPECT_EQ(answer.grid.data, query_traversability(whole, query_of(region)).grid.data);
  }
}

TEST_F(TraversabilityService, ChecksPathsAndFindsPlaces) {
  const NearestTraversable start = client_.nearest_traversable("delivery_robot", {4.0, 0.0});
  ASSERT_EQ(start.status, TraversabilityStatus::ok) << start.reason;
  // What the last scans changed may be published only now.
  EXPECT_TRUE(eventually([&] {
    return client_.nearest_traversable("delivery_robot", {4.0, 0.0}).map_version ==
           client_.status().map_version;
  }));
  PathQuery path{
      .profile = "delivery_robot", .positions_map = {start.position_map}, .headings_rad = {0.0}};
  EXPECT_EQ(client_.check_path(path).status, TraversabilityStatus::ok);
  // Through the wall at y = 14.
  path.positions_map.emplace_back(start.position_map.x(), 20.0);
  path.headings_rad.clear();
  const PathCheck check = client_.check_path(path);
  ASSERT_EQ(check.status, TraversabilityStatus::ok) << check.reason;
  ASSERT_TRUE(check.conflict);
  EXPECT_FALSE(check.is_free);
  EXPECT_LT(check.conflict->cell_centre_map.y(), 14.6);
}

TEST_F(TraversabilityService, RefusesHostileRequestsWithTheirReasonAndGoesOn) {
  using enum TraversabilityStatus;
  BoxRegion huge;
  huge.box_map = {Eigen::Vector3d::Constant(-1e9), Eigen::Vector3d::Constant(1e9)};
  BoxRegion of_nan;
  of_nan.box_map.min().x() = nan;
  const auto expect_area = [&](const TraversabilityQuery& query, TraversabilityStatus status,
                               const std::string& named) {
    const TraversabilityAnswer answer = client_.get_traversable_area(query);
    EXPECT_EQ(answer.grid.status, status) << named;
    EXPECT_THAT(answer.grid.reason, HasSubstr(named));
    EXPECT_TRUE(answer.grid.data.empty());
  };
  expect_area(query_of(huge), invalid_request, "box x is from -1e+09");
  expect_area(query_of(of_nan), invalid_request, "box x is from nan");
  expect_area(query_of(CorridorRegion{}), invalid_request, "corridor path has 0 points");
  expect_area(
      query_of(PolygonRegion{.corners_map = {{0, 0}, {9, 9}, {9, 0}, {0, 9}}, .heights = {}}),
      invalid_request, "polygon edges 0");
  expect_area(query_of(BoxRegion{}, "submarine"), invalid_request, "car, delivery_robot");
  expect_area(query_of(SphereRegion{.centre_map = {5e5, 0, 0}, .radius_m = 3}), not_found,
              "outside the map");
  TraversabilityQuery tiny = query_of(BoxRegion{});
  tiny.max_cells = 3;
  expect_area(tiny, too_large, "at most 3");

  const auto expect_path = [&](const PathQuery& query, TraversabilityStatus status,
                               const std::string& named) {
    const PathCheck check = client_.check_path(query);
    EXPECT_EQ(check.status, status) << named;
    EXPECT_THAT(check.reason, HasSubstr(named));
    EXPECT_FALSE(check.is_free);
  };
  expect_path(path_of("car", {}), invalid_request, "no poses");
  expect_path(path_of("boat", {{0, 0}, {1, 0}}), invalid_request, "'boat'");
  expect_path(path_of("car", {{0, 0}, {nan, 0}}), invalid_request, "nan");
  expect_path(path_of("car", {{0, 0}, {9e4, 0}}), too_large, "parts");
  const std::vector<Eigen::Vector2d> many(1'000'000, Eigen::Vector2d::Zero());
  expect_path(path_of("car", many), too_large, "1000000 positions");

  const auto nearest = [&](const std::string& profile, double x_m, double max_distance_m) {
    return client_.nearest_traversable(profile, {x_m, 0.0}, max_distance_m);
  };
  EXPECT_EQ(nearest("car", nan, 5.0).status, invalid_request);
  EXPECT_EQ(nearest("car", 1e9, 5.0).status, invalid_request);
  EXPECT_EQ(nearest("car", 0.0, -1.0).status, invalid_request);
  EXPECT_EQ(nearest("car", 9e4, 5.0).status, not_found);
  EXPECT_THAT(nearest("boat", 0.0, 5.0).reason, HasSubstr("car, delivery_robot"));
  EXPECT_EQ(client_.get_traversable_area(query_of(BoxRegion{})).grid.status, ok);
  EXPECT_EQ(client_.status().health, OdometryHealth::good);
}

TEST_F(TraversabilityService, PublishesTheGridThatNav2AsksFor) {
  std::mutex mutex;
  OccupancyGrid newest;
  const Subscription subscription = client_.subscribe_planning_grid([&](const OccupancyGrid& grid) {
    const std::scoped_lock lock(mutex);
    newest = grid;
  });
  const TraversabilityAnswer answer = client_.get_traversable_area(query_of(BoxRegion{}));
  // It comes although it was published before anybody listened.
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return newest.data == answer.grid.data;
  }));
  const OccupancyGrid asked = client_.planning_grid();
  EXPECT_EQ(asked.data, answer.grid.data);
  EXPECT_EQ(asked.origin_map, answer.grid.origin_map);
  EXPECT_EQ(asked.resolution_m, answer.grid.resolution_m);

  static_cast<void>(client_.reset());
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return newest.data.empty();
  }));
  EXPECT_EQ(client_.get_traversable_area(query_of(BoxRegion{})).grid.status,
            TraversabilityStatus::not_found);
}

TEST_F(TraversabilityService, TellsHowLongAChangeTakes) {
  // The areas are there a moment before the time that they took is.
  EXPECT_TRUE(eventually([&] {
    const dds::ServerStatus status = client_.status();
    const auto found =
        std::ranges::find(status.latencies, "traversability", &dds::StageLatency::stage);
    return found != status.latencies.end() && found->samples > 0 && found->p50_ms > 0.0;
  }));
}

TEST(TraversabilityConfiguration, AnUnknownRobotEndsTheServerWithTheNamesThereAre) {
  const ScratchFolder folder;
  std::ofstream(folder / "server.yaml") << "traversability: {profiles: [submarine]}\n";
  testing::internal::CaptureStderr();
  ServerProcess server({"--config", (folder / "server.yaml").string()});
  EXPECT_EQ(server.wait_for_exit(patience), 2);
  EXPECT_THAT(
      testing::internal::GetCapturedStderr(),
      testing::AllOf(testing::HasSubstr("submarine"), testing::HasSubstr("delivery_robot")));
}

}  // namespace
}  // namespace stillmap::test
