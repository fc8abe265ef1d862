#include <gmock/gmock.h>

#include <atomic>
#include <csignal>
#include <limits>
#include <mutex>
#include <thread>
#include <vector>

#include "core/occupancy/occupancy_map.hpp"
#include "tests/numbers.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

using test::nan;
constexpr double infinite = std::numeric_limits<double>::infinity();

Eigen::AlignedBox3d everything() {
  const Eigen::Vector3d far = Eigen::Vector3d::Constant(1000.0);
  return {-far, far};
}

class OccupancyService : public testing::Test {
 protected:
  OccupancyService()
      : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    drive(publisher_, 0, 8);
    EXPECT_TRUE(wait_for_scans(client_, 8));
    EXPECT_TRUE(eventually([&] { return scans_in_octree() == 8; }));
    EXPECT_GT(voxels().occupied, 1000U);
    EXPECT_GT(voxels().free, 1000U);
  }

  /// The octree follows the map within a moment.
  [[nodiscard]] std::uint32_t scans_in_octree() {
    for (const dds::StageLatency& stage : client_.status().latencies) {
      if (stage.stage == "occupancy") return stage.samples;
    }
    return 0;
  }

  [[nodiscard]] BoxOccupancy voxels() {
    OccupancyQuery query;
    query.boxes_map = {everything()};
    query.max_voxels = 0;
    return client_.query_occupancy(query).boxes.at(0);
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
  ScanPublisher publisher_{setup_.publisher(true)};
};

TEST_F(OccupancyService, GivesAnOctomapThatHoldsTheRoom) {
  for (const OctomapEncoding encoding : {OctomapEncoding::binary, OctomapEncoding::full}) {
    const OctomapData data = client_.octomap(encoding);
    EXPECT_EQ(data.encoding, encoding);
    EXPECT_EQ(data.resolution_m, 0.2);
    const BoxOccupancy all = OccupancyMap(data).in_box(everything(), 0);
    EXPECT_EQ(all.occupied, voxels().occupied);
    EXPECT_EQ(all.free, voxels().free);
  }
}

TEST_F(OccupancyService, AnswersPointsBoxesAndRaysOfOneRequest) {
  const OccupancyMap map(client_.octomap(OctomapEncoding::full));
  OccupancyQuery query;
  query.points_map = {{0.0, 0.0, 0.1}, {3.0, 1.0, 0.1}, {900.0, 0.0, 0.0}};
  query.boxes_map = {everything()};
  query.max_voxels = 50;
  for (const auto& direction : {Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0.2, -1, 0.01)}) {
    query.rays.push_back({.origin_map = {0.0, 0.0, 0.1}, .direction_map = direction});
  }
  const OccupancyAnswers answers = client_.query_occupancy(query);
  const OccupancyAnswers expected = map.answer(query);
  EXPECT_EQ(answers.resolution_m, expected.resolution_m);
  ASSERT_EQ(answers.points.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(answers.points[i].occupancy, expected.points[i].occupancy);
    EXPECT_EQ(answers.points[i].probability, expected.points[i].probability);
  }
  EXPECT_EQ(answers.points[0].occupancy, Occupancy::free);
  EXPECT_EQ(answers.points[2].occupancy, Occupancy::unknown);
  ASSERT_EQ(answers.boxes.size(), 1U);
  EXPECT_EQ(answers.boxes[0].occupied_map, expected.boxes[0].occupied_map);
  EXPECT_EQ(answers.boxes[0].occupied_map.size(), 50U);
  ASSERT_EQ(answers.rays.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(answers.rays[i].end, expected.rays[i].end);
    EXPECT_EQ(answers.rays[i].length_m, expected.rays[i].length_m);
    EXPECT_EQ(answers.rays[i].end_map, expected.rays[i].end_map);
  }
}

TEST_F(OccupancyService, HostileQueriesGetAReasonEachAndHarmNoOther) {
  OccupancyQuery query;
  query.points_map = {{nan, 0, 0}, {0, 0, 0.1}, {1e9, 0, 0}};
  Eigen::AlignedBox3d box;
  for (const auto& [low, high] : {std::pair(-1e9, 1e9), std::pair(-infinite, infinite),
                                  std::pair(nan, 1.0), std::pair(1.0, -1.0)}) {
    box.min().setConstant(low);
    box.max().setConstant(high);
    query.boxes_map.push_back(box);
  }
  query.rays = {{.direction_map = {0, 0, 0}},
                {.direction_map = {nan, 1, 0}},
                {.origin_map = {0, 1e9, 0}},
                {.max_range_m = 1e9},
                {.max_range_m = nan}};
  const OccupancyAnswers answers = client_.query_occupancy(query);
  EXPECT_THAT(answers.points[0].fault, HasSubstr("point is nan"));
  EXPECT_EQ(answers.points[1].fault, "");
  EXPECT_EQ(answers.points[1].occupancy, Occupancy::free);
  EXPECT_THAT(answers.points[2].fault, HasSubstr("reaches from"));
  for (const BoxOccupancy& one : answers.boxes) EXPECT_THAT(one.fault, HasSubstr("box's minimum"));
  for (const RayOccupancy& one : answers.rays) EXPECT_THAT(one.fault, HasSubstr("ray's"));
}

TEST_F(OccupancyService, RefusesAQueryThatAsksForTooMuch) {
  OccupancyQuery query;
  query.rays.resize(OccupancyQuery::max_rays + 1);
  try {
    static_cast<void>(client_.query_occupancy(query));
    FAIL() << "answered";
  } catch (const ServiceError& error) {
    EXPECT_THAT(error.what(), HasSubstr("1001 rays"));
    EXPECT_EQ(error.code(), wire::ReplyCode::invalid_request);
  }
  EXPECT_GT(voxels().occupied, 0U);
}

TEST_F(OccupancyService, PublishesTheOctreeToWhoComesLate) {
  std::atomic<std::size_t> bytes = 0;
  const Subscription octomaps =
      client_.subscribe_octomap([&](const OctomapData& data) { bytes = data.bytes.size(); });
  EXPECT_TRUE(eventually([&] { return bytes > 100; }));
}

/// The sizes of the octrees that a new reader gets, in their order.
class LateReader {
 public:
  explicit LateReader(Client& client)
      : subscription_(client.subscribe_octomap([this](const OctomapData& data) {
          const std::scoped_lock lock(mutex_);
          bytes_.push_back(data.bytes.size());
        })) {}

  /// Of the first; 0 when none comes for so long.
  [[nodiscard]] std::size_t first_bytes(std::chrono::milliseconds timeout) {
    std::size_t first = 0;
    const auto has_come = [&] {
      const std::scoped_lock lock(mutex_);
      if (!bytes_.empty()) first = bytes_.front();
      return !bytes_.empty();
    };
    return eventually(has_come, timeout) ? first : 0;
  }

 private:
  std::mutex mutex_;
  std::vector<std::size_t> bytes_;
  Subscription subscription_;
};

TEST_F(OccupancyService, WhoComesLateGetsTheOctreeAsItIsNow) {
  const std::size_t early_bytes = LateReader(client_).first_bytes(patience);
  EXPECT_EQ(early_bytes, client_.octomap(OctomapEncoding::binary).bytes.size());
  drive(publisher_, 8, 60);
  ASSERT_TRUE(wait_for_scans(client_, 60));
  ASSERT_TRUE(eventually([&] {
    return scans_in_octree() + client_.status().counter("occupancy_scans_dropped") == 60;
  }));
  const std::size_t now_bytes = client_.octomap(OctomapEncoding::binary).bytes.size();
  EXPECT_NE(now_bytes, early_bytes);
  EXPECT_EQ(LateReader(client_).first_bytes(patience), now_bytes);
}

TEST_F(OccupancyService, WhoComesLateGetsNoOctreeOfAMapThatIsNoMore) {
  // One reader stays, so that the topic is never idle.
  LateReader stays(client_);
  const std::size_t old_bytes = stays.first_bytes(patience);
  ASSERT_GT(old_bytes, 100U);
  static_cast<void>(client_.reset());
  // Withdrawn at once: long before a new one replaces it.
  EXPECT_TRUE(eventually([&] {
    return LateReader(client_).first_bytes(std::chrono::milliseconds(2000)) < old_bytes;
  }));
}

TEST_F(OccupancyService, AResetBeginsAnEmptyOctree) {
  static_cast<void>(client_.reset());
  EXPECT_TRUE(eventually([&] { return voxels().occupied == 0; }));
  EXPECT_TRUE(client_.octomap(OctomapEncoding::full).bytes.empty());
}

TEST(OccupancyAfterARestart, BeginsWithTheStoredStaticMap) {
  const ServiceSetup setup("every");
  MapQueryResult stored;
  {
    ServerProcess server(setup.server_arguments());
    Client client(setup.client());
    ScanPublisher publisher(setup.publisher(true));
    drive(publisher, 0, 8);
    ASSERT_TRUE(wait_for_scans(client, 8));
    static_cast<void>(client.save_map());
    stored = client.get_whole_static_map({});
    server.send(SIGTERM);
    EXPECT_EQ(server.wait_for_exit(patience), 0);
  }
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  OccupancyQuery query;
  for (const QueryVoxel& voxel : stored.voxels) {
    if (query.points_map.size() < 1000) {
      query.points_map.emplace_back(voxel.position_map.cast<double>());
    }
  }
  ASSERT_FALSE(query.points_map.empty());
  // While the octree is being made, a query waits or is refused: nothing known is no answer.
  ASSERT_TRUE(eventually([&] {
    try {
      EXPECT_EQ(client.query_occupancy(query).points.at(0).occupancy, Occupancy::occupied);
      return true;
    } catch (const ServiceError& error) {
      EXPECT_THAT(error.what(), HasSubstr("ask again"));
      return false;
    }
  }));
  EXPECT_FALSE(client.octomap(OctomapEncoding::full).bytes.empty());
  for (const PointOccupancy& point : client.query_occupancy(query).points) {
    ASSERT_EQ(point.occupancy, Occupancy::occupied);
    EXPECT_NEAR(point.probability, 0.971F, 1e-3F);
  }
}

}  // namespace
}  // namespace stillmap::test
