#include "server/traversability/traversability_thread.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>
#include <stdexcept>

#include "core/traversability/path_check.hpp"
#include "server/traversability/traversability_grid.hpp"
#include "tests/eventually.hpp"
#include "tests/server/manual_clock.hpp"
#include "tests/slowdown.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;
using ::testing::AllOf;
using ::testing::HasSubstr;

RobotProfile small_robot() {
  RobotProfile robot = square_robot();
  robot.name = "small";
  robot.length_m = 0.4;
  robot.width_m = 0.4;
  return robot;
}

std::shared_ptr<const MapSnapshot> shared(const MapSnapshot& view) {
  return std::make_shared<const MapSnapshot>(view);
}

/// The tiles of a map, to be read as if they were on disk.
class StoredTiles : public TileStore {
 public:
  explicit StoredTiles(MapSnapshot map) : map_(std::move(map)) {}
  TileRecord load(TileId id) override { return {map_.tiles.find(id), nullptr}; }

 private:
  MapSnapshot map_;
};

/// A thread on a map of a road, 16 m by 16 m.
class TraversabilityThreadTest : public testing::Test {
 protected:
  TraversabilityThreadTest() {
    world_.ground(-8, -8, 8, 8, road);
    latest_map_.begin(shared(world_.view()), {});
  }

  void start(std::chrono::duration<double> period) {
    const auto updated = [this] {
      const std::scoped_lock lock(mutex_);
      ++updates_;
      updated_.notify_all();
    };
    const FollowedMap map{.latest = latest_map_, .tiles = tiles_, .bytes_on_disk = bytes_on_disk_};
    thread_.emplace(
        std::vector{square_robot(), small_robot()}, map, snapshot_, statistics_,
        TraversabilityUpdates{
            .period = period, .updated = updated, .scheduling = BackgroundScheduling::normal},
        clock_);
  }

  [[nodiscard]] bool wait_for(const std::function<bool(const TraversabilityView&)>& is_so) {
    std::unique_lock lock(mutex_);
    return updated_.wait_for(lock, 60s * test::slowdown,
                             [&] { return is_so(*snapshot_.view("small")); });
  }
  [[nodiscard]] bool wait_for_version(std::uint64_t version) {
    return wait_for([&](const TraversabilityView& view) { return view.version == version; });
  }

  [[nodiscard]] double cost_at(const std::string& robot, double x_m, double y_m) const {
    return test::look(*snapshot_.view(robot), x_m, y_m).cell.cost;
  }

  VoxelWorld world_;
  LatestMap latest_map_;
  TileReader tiles_;
  std::size_t bytes_on_disk_ = 0;
  TraversabilitySnapshot snapshot_;
  Statistics statistics_;
  test::ManualClock clock_;
  std::mutex mutex_;
  std::condition_variable updated_;
  int updates_ = 0;
  std::optional<TraversabilityThread> thread_;
};

TEST_F(TraversabilityThreadTest, KeepsEveryRobotsViewUpToDate) {
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  EXPECT_EQ(cost_at("small", 1.1, 1.1), 0);
  world_.block(1, 1, 2, 2, 0.3, 2.0, building);
  latest_map_.publish(shared(world_.view()));
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  EXPECT_EQ(cost_at("small", 1.1, 1.1), 100);
  for (const RobotProfile& robot : {square_robot(), small_robot()}) {
    const auto fresh = test::traversability_of(*latest_map_.view(), robot);
    const auto kept = snapshot_.view(robot.name);
    ASSERT_EQ(kept->tiles.size(), fresh->tiles.size());
    for (std::size_t i = 0; i < fresh->tiles.size(); ++i) {
      EXPECT_EQ(kept->tiles[i]->cells, fresh->tiles[i]->cells);
    }
  }
}

TEST_F(TraversabilityThreadTest, TellsHowLongAChangeTakes) {
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  thread_.reset();
  EXPECT_EQ(updates_, 1);
  dds::ServerStatus status;
  statistics_.report_to(status);
  ASSERT_EQ(status.latencies.size(), 1U);
  EXPECT_EQ(status.latencies[0].stage, "traversability");
  EXPECT_EQ(status.latencies[0].samples, 1U);
  EXPECT_GT(status.latencies[0].p50_ms, 0.0);
}

TEST_F(TraversabilityThreadTest, UpdatesOnceAPeriodHoweverOftenTheMapChanges) {
  start(3600s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  const std::uint64_t first = snapshot_.view("small")->version;
  for (int i = 0; i < 5; ++i) {
    world_.block(1 + i, 1, 2 + i, 2, 0.3, 2.0, building);
    latest_map_.publish(shared(world_.view()));
  }
  const auto pause = clock_.wait_for_sleeper();
  ASSERT_TRUE(pause);
  EXPECT_EQ(*pause, 3600s);
  EXPECT_EQ(snapshot_.view("small")->version, first);
  clock_.advance(*pause);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  EXPECT_EQ(updates_, 2);
  // Destroying it must not take the next hour.
  world_.block(1, 1, 2, 2, 2.0, 3.0, building);
  latest_map_.publish(shared(world_.view()));
  ASSERT_TRUE(clock_.wait_for_sleeper());
  thread_.reset();
  EXPECT_EQ(updates_, 2);
}

TEST_F(TraversabilityThreadTest, KnowsWhichTilesItHas) {
  const std::shared_ptr<const MapSnapshot> all = latest_map_.view();
  const std::shared_ptr<const Tile> tile = *all->tiles.begin();
  Tile on_disk = *tile;
  on_disk.voxels = {};
  ASSERT_TRUE(is_non_resident(on_disk));
  auto without = std::make_shared<MapSnapshot>(*all);
  without->tiles.set(std::make_shared<const Tile>(on_disk));
  const TileRange everywhere{{-100, -100}, {100, 100}};
  const auto views = [&] {
    TraversabilityMap map({small_robot()});
    static_cast<void>(map.update(*all));
    return TraversabilitySnapshot::Views{map.view("small")};
  };
  snapshot_.publish(views(), {all, everywhere});
  EXPECT_TRUE(snapshot_.known("small").has(*tile));
  EXPECT_FALSE(snapshot_.known("small").has(on_disk)) << "evicted since";
  snapshot_.publish(views(), {all, {{50, 50}, {60, 60}}});
  EXPECT_FALSE(snapshot_.known("small").has(*tile)) << "outside of the window";
  // Read from the disk since the view was made: the view has nothing there.
  snapshot_.publish(views(), {without, everywhere});
  EXPECT_FALSE(snapshot_.known("small").has(*tile));
  // A tile that is new will be in the next view.
  snapshot_.publish(views(), {std::make_shared<MapSnapshot>(), everywhere});
  EXPECT_TRUE(snapshot_.known("small").has(*tile));
}

TEST_F(TraversabilityThreadTest, FollowsToAnotherMap) {
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  MapSnapshot other;
  other.map_id = latest_map_.view()->map_id + 1;
  other.version = 99;
  latest_map_.begin(shared(other), {});
  ASSERT_TRUE(wait_for_version(99));
  EXPECT_TRUE(snapshot_.view("small")->tiles.empty());
  EXPECT_EQ(snapshot_.view("small")->map_id, other.map_id);
}

TEST_F(TraversabilityThreadTest, AnswersAreNeverOfTheMapBefore) {
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  thread_.reset();
  TileReader tiles;
  const TraversabilityCache cache(snapshot_, latest_map_, tiles);
  const Eigen::AlignedBox2d box(Eigen::Vector2d(-2.0, -2.0), Eigen::Vector2d(4.0, 4.0));
  EXPECT_EQ(test::look(*cache.view("small", box), 1.1, 1.1).cell.cost, 0);
  VoxelWorld walled;
  walled.ground(-8, -8, 8, 8, road);
  walled.block(1, 1, 2, 2, 0.3, 2.0, building);
  MapSnapshot other = walled.view();
  other.map_id = latest_map_.view()->map_id + 1;
  latest_map_.begin(shared(other), {});
  const auto view = cache.view("small", box);
  EXPECT_EQ(test::look(*view, 1.1, 1.1).cell.cost, 100);
  EXPECT_EQ(view->map_id, other.map_id);
  MapSnapshot empty;
  empty.map_id = other.map_id + 1;
  latest_map_.begin(shared(empty), {});
  EXPECT_TRUE(cache.view("small", box)->tiles.empty());
}

TEST_F(TraversabilityThreadTest, AnswersAreNeverOfTheMapBeforeItsCorrection) {
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  thread_.reset();
  TileReader tiles;
  const TraversabilityCache cache(snapshot_, latest_map_, tiles, 1h);
  const Eigen::AlignedBox2d box(Eigen::Vector2d(-1.0, -1.0), Eigen::Vector2d(3.0, 3.0));
  const auto before = cache.view("small", box);
  EXPECT_EQ(test::look(*before, 1.1, 1.1).cell.cost, 0);
  // What follows the map as it grows is as of the last update.
  world_.block(1, 1, 2, 2, 0.3, 2.0, building);
  latest_map_.publish(shared(world_.view()));
  EXPECT_EQ(cache.view("small", box), before);
  world_.block(2, 2, 3, 3, 0.3, 2.0, building);
  latest_map_.correct(MapCorrection(std::vector{MapCorrection::Pose{.stamp_ns = 0}}),
                      shared(world_.view()));
  EXPECT_EQ(test::look(*cache.view("small", box), 1.1, 1.1).cell.cost, 100);
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  EXPECT_EQ(cache.view("small", box), snapshot_.view("small"));
}

TEST_F(TraversabilityThreadTest, AnswersDoNotWaitForAViewThatIsFarBehind) {
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  // As where other programs take all cores from a thread of idle priority.
  thread_.reset();
  TileReader tiles;
  const TraversabilityCache patient(snapshot_, latest_map_, tiles, 1h);
  const TraversabilityCache impatient(snapshot_, latest_map_, tiles, 0ms);
  const Eigen::AlignedBox2d box(Eigen::Vector2d(-1.0, -1.0), Eigen::Vector2d(3.0, 3.0));
  const auto kept = snapshot_.view("small");
  EXPECT_EQ(impatient.view("small", box), kept) << "nothing has changed";
  world_.block(1, 1, 2, 2, 0.3, 2.0, building);
  latest_map_.publish(shared(world_.view()));
  EXPECT_EQ(patient.view("small", box), kept);
  const auto now = impatient.view("small", box);
  EXPECT_EQ(now->version, latest_map_.view()->version);
  EXPECT_EQ(test::look(*now, 1.1, 1.1).cell.cost, 100);
  EXPECT_EQ(impatient.view("small", box), now) << "as long as nothing changes";
  world_.block(2, 1, 3, 2, 0.3, 2.0, building);
  latest_map_.publish(shared(world_.view()));
  EXPECT_EQ(test::look(*impatient.view("small", box), 2.1, 1.1).cell.cost, 100);
}

TEST_F(TraversabilityThreadTest, AViewThatIsUpdatedSeldomIsNotBehindBeforeItsPeriodIsOver) {
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  thread_.reset();
  TileReader tiles;
  const TraversabilityCache cache(snapshot_, latest_map_, tiles,
                                  TraversabilityCache::longest_lag(10s));
  const auto known = snapshot_.known("small");
  const auto publish_as_of = [&](std::chrono::seconds age) {
    MapInWindow of = known;
    of.map_time = std::chrono::steady_clock::now() - age;
    snapshot_.publish({known.view}, std::move(of));
  };
  world_.block(1, 1, 2, 2, 0.3, 2.0, building);
  latest_map_.publish(shared(world_.view()));
  const Eigen::AlignedBox2d box(Eigen::Vector2d(-1.0, -1.0), Eigen::Vector2d(3.0, 3.0));
  publish_as_of(11s);
  EXPECT_EQ(cache.view("small", box), known.view);
  publish_as_of(13s);
  EXPECT_EQ(test::look(*cache.view("small", box), 1.1, 1.1).cell.cost, 100);
}

TEST_F(TraversabilityThreadTest, APathIsAnsweredByTheTilesAlongIt) {
  VoxelWorld grid(50);
  for (int street = -145; street < 150; street += 10)
    grid.ground(-150, street, 150, street + 1, road);
  latest_map_.publish(shared(grid.view()));
  const TraversabilitySnapshot::Views nothing{traversability_of(MapSnapshot(), small_robot())};
  snapshot_.publish(nothing, {latest_map_.view(), {{99, 99}, {99, 99}}});
  TileReader tiles;
  const TraversabilityCache cache(snapshot_, latest_map_, tiles);
  const std::vector<Eigen::Vector2d> positions{{-144.5, -144.5}, {144.5, -144.5}, {144.5, 144.5}};
  Eigen::AlignedBox2d round_path;
  for (const Eigen::Vector2d& position : positions) round_path.extend(position);
  EXPECT_THAT([&] { static_cast<void>(cache.view("small", round_path)); },
              testing::ThrowsMessage<std::invalid_argument>(HasSubstr("ask for parts")));
  const auto all = traversability_of(*latest_map_.view(), small_robot());
  const auto along = cache.view("small", boxes_along(positions, 10.0));
  EXPECT_LT(along->tiles.size(), all->tiles.size() / 2);
  for (double x = -140.0; x < 140.0; x += 7.3) {
    EXPECT_EQ(test::look(*along, x, -144.5).cell.cost, test::look(*all, x, -144.5).cell.cost) << x;
    EXPECT_EQ(test::look(*along, 144.5, x).cell.cost, test::look(*all, 144.5, x).cell.cost) << x;
  }
}

TEST_F(TraversabilityThreadTest, TheWindowFollowsARobotThatAddsNothingToTheMap) {
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  const auto updates = [this] {
    const std::scoped_lock lock(mutex_);
    return updates_;
  };
  const int before = updates();
  StampedPose pose{.stamp_ns = 5'000'000'000};
  pose.T_map_lidar.translation().x() = 5.0;
  latest_map_.add_pose(pose, OdometryHealth::degenerate, "");
  EXPECT_TRUE(test::eventually([&] { return updates() > before; }));
  // Beyond the window round where it was.
  pose.T_map_lidar.translation().x() = 2000.0;
  latest_map_.add_pose(pose, OdometryHealth::degenerate, "");
  EXPECT_TRUE(test::eventually([&] { return snapshot_.view("small")->tiles.empty(); }));
}

TEST_F(TraversabilityThreadTest, AGridThatWouldBeTooLargeIsThatRoundTheRobot) {
  // Corners of a square of a kilometre.
  world_.ground(-502, -502, -498, -498, road);
  world_.ground(498, 498, 502, 502, road);
  latest_map_.publish(shared(world_.view()));
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  TraversabilityConfig config;
  config.profiles = {"small"};
  config.grid_profile = "small";
  const TraversabilityGridProvider whole(config, "map", latest_map_, snapshot_);
  const OccupancyGrid grid = whole.grid();
  ASSERT_EQ(grid.status, TraversabilityStatus::ok) << grid.reason;
  EXPECT_THAT(grid.reason, HasSubstr("m round the robot"));
  EXPECT_NEAR(grid.width, 4998.0, 2.0);
  EXPECT_EQ(grid.data.size(), std::size_t{grid.width} * grid.height);
}

TEST_F(TraversabilityThreadTest, NamesTheRobotsThereAre) {
  const auto refusal = [&](const std::string& profile) -> std::string {
    try {
      static_cast<void>(snapshot_.view(profile));
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "no refusal";
  };
  EXPECT_THAT(refusal("car"), HasSubstr("traversability.profiles is empty"));
  start(0s);
  EXPECT_THAT(refusal("car"), AllOf(HasSubstr("'car'"), HasSubstr("small")));
}

TEST_F(TraversabilityThreadTest, TheGridIsAWindowRoundTheRobot) {
  TraversabilityConfig config;
  config.profiles = {"small"};
  config.grid_profile = "small";
  config.grid_window_m = 4.0;
  const TraversabilityGridProvider window(config, "map", latest_map_, snapshot_);
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  StampedPose pose{.stamp_ns = 5'000'000'000};
  pose.T_map_lidar.translation().x() = 4.0;
  latest_map_.add_pose(pose, OdometryHealth::good, "");
  const StampedGrid grid = window.grid();
  ASSERT_EQ(grid.status, TraversabilityStatus::ok) << grid.reason;
  EXPECT_EQ(grid.width, 20U);
  EXPECT_NEAR(grid.origin_map.x(), 2.0, 1e-9);
  EXPECT_NEAR(grid.origin_map.y(), -2.0, 1e-9);
  EXPECT_EQ(window.message(grid).header().stamp().sec(), 5);
  EXPECT_EQ(window.message(grid).header().frame_id(), "map");
  config.grid_window_m = 0.0;
  EXPECT_EQ(TraversabilityGridProvider(config, "map", latest_map_, snapshot_).grid().width, 80U);
  config.grid_profile = "";
  EXPECT_EQ(TraversabilityGridProvider(config, "map", latest_map_, snapshot_).grid().status,
            TraversabilityStatus::not_found);
}

// As after a start with a map file: nothing is in memory but what the first scans reach.
TEST_F(TraversabilityThreadTest, TilesOnDiskAreInItAsFarAsMemoryAllows) {
  world_.ground(8, -2, 400, 2, road);
  const MapSnapshot whole = world_.view();
  tiles_.use_tile_store(std::make_shared<StoredTiles>(whole));
  MapSnapshot on_disk = whole;
  for (const auto& tile : whole.tiles) on_disk.tiles.set(without_voxels(*tile));
  latest_map_.publish(shared(on_disk));
  bytes_on_disk_ = std::size_t{1} << 30;
  start(0s);
  ASSERT_TRUE(wait_for(
      [&](const TraversabilityView& view) { return view.tiles.size() == whole.tiles.size(); }));
  const auto state_at = [&](double x_m) {
    return test::look(*snapshot_.view("small"), x_m, 0.1).cell.state;
  };
  for (const double x_m : {1.1, 50.1, 390.1}) EXPECT_EQ(state_at(x_m), CellState::free) << x_m;

  thread_.reset();
  constexpr std::size_t tiles = 40;
  bytes_on_disk_ = tiles * 20 * 20 * 93;
  start(0s);
  // More than are read at a time.
  ASSERT_TRUE(
      wait_for([&](const TraversabilityView& view) { return view.tiles.size() == tiles * 7 / 8; }));
  EXPECT_EQ(state_at(1.1), CellState::free);
  EXPECT_EQ(state_at(390.1), CellState::unknown);
}

// They may be in the file of the map that was there before, for a moment.
TEST_F(TraversabilityThreadTest, TilesThatCannotBeReadAreTriedAgain) {
  const MapSnapshot whole = world_.view();
  MapSnapshot on_disk = whole;
  for (const auto& tile : whole.tiles) on_disk.tiles.set(without_voxels(*tile));
  latest_map_.publish(shared(on_disk));
  bytes_on_disk_ = std::size_t{1} << 30;
  start(0s);
  ASSERT_TRUE(wait_for_version(whole.version));
  EXPECT_TRUE(snapshot_.view("small")->tiles.empty());
  tiles_.use_tile_store(std::make_shared<StoredTiles>(whole));
  clock_.advance(10s);
  EXPECT_TRUE(wait_for(
      [&](const TraversabilityView& view) { return view.tiles.size() == whole.tiles.size(); }));
}

TEST_F(TraversabilityThreadTest, TheGridIsNeverOfTheMapBefore) {
  TraversabilityConfig config;
  config.profiles = {"small"};
  config.grid_profile = "small";
  const TraversabilityGridProvider provider(config, "map", latest_map_, snapshot_);
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  thread_.reset();
  ASSERT_EQ(provider.grid().status, TraversabilityStatus::ok);
  MapSnapshot other = world_.view();
  other.map_id = latest_map_.view()->map_id + 1;
  latest_map_.begin(shared(other), {});
  const StampedGrid grid = provider.grid();
  EXPECT_EQ(grid.status, TraversabilityStatus::not_found);
  EXPECT_THAT(grid.reason, HasSubstr("another map began"));
  EXPECT_EQ(provider.message(grid).data().size(), 0U);
  start(0s);
  ASSERT_TRUE(wait_for_version(other.version));
  EXPECT_EQ(provider.grid().status, TraversabilityStatus::ok);
}

TEST_F(TraversabilityThreadTest, AGridOfTheMapBeforeItsCorrectionHasTheStampOfThen) {
  TraversabilityConfig config;
  config.profiles = {"small"};
  config.grid_profile = "small";
  const TraversabilityGridProvider provider(config, "map", latest_map_, snapshot_);
  latest_map_.add_pose({.stamp_ns = 5'000'000'000}, OdometryHealth::good, "");
  start(0s);
  ASSERT_TRUE(wait_for_version(latest_map_.view()->version));
  thread_.reset();
  latest_map_.add_pose({.stamp_ns = 6'000'000'000}, OdometryHealth::good, "");
  EXPECT_EQ(provider.grid().stamp_ns, 6'000'000'000);
  latest_map_.correct(MapCorrection(std::vector{MapCorrection::Pose{.stamp_ns = 0}}),
                      shared(world_.view()));
  EXPECT_EQ(provider.grid().stamp_ns, 5'000'000'000);
}

}  // namespace
}  // namespace stillmap::server
