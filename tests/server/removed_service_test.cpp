#include <SQLiteCpp/Database.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "clients/library/tile_mirror.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// The room with cars that stand where its pillars are.
Scan room_with_cars(int index) {
  Scan scan = room_scan(index);
  std::ranges::replace(scan.labels, SemanticClass::pole, SemanticClass::car);
  return scan;
}

/// What the server says to a request that it refuses.
template <typename Ask>
[[nodiscard]] std::string refusal(Ask ask) {
  try {
    ask();
  } catch (const ServiceError& error) {
    return error.what();
  }
  return "not refused";
}

class RemovedService : public testing::Test {
 protected:
  RemovedService() : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    client_.wait_for_server(patience);
    ScanPublisher publisher(setup_.publisher(true));
    EXPECT_TRUE(publisher.wait_for_subscriber(patience));
    for (int i = 0; i < 10; ++i) {
      EXPECT_TRUE(publisher.publish(room_with_cars(i), {}, patience));
    }
    EXPECT_TRUE(wait_for_scans(client_, 10));
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
};

TEST_F(RemovedService, ParkedCarsAreRememberedAndCanBeBroughtBack) {
  const RemovedVoxels removed = client_.get_removed(BoxRegion{});
  ASSERT_GT(removed.total, 20U);
  EXPECT_EQ(removed.voxels.size(), removed.total);
  for (const RemovedVoxel& voxel : removed.voxels) EXPECT_EQ(voxel.label, SemanticClass::car);
  EXPECT_EQ(client_.get_removed(BoxRegion{}, 3).voxels.size(), 3U);

  MapQuery cars;
  cars.classes.set(static_cast<std::size_t>(SemanticClass::car));
  EXPECT_EQ(client_.get_whole_static_map(cars).voxels.size(), 0U);
  const auto reason = removed.voxels.front().reason;
  EXPECT_GT(client_.restore_removed(reason, BoxRegion{}), 20U);
  EXPECT_GT(client_.get_whole_static_map(cars).voxels.size(), 20U);
  EXPECT_LT(client_.get_removed(BoxRegion{}).total, removed.total);
}

TEST_F(RemovedService, RefusesWhatMakesNoSenseAndGoesOn) {
  const PolygonRegion crossed{.corners_map = {{0, 0}, {9, 9}, {9, 0}, {0, 9}}, .heights = {}};
  EXPECT_THAT(refusal([&] { static_cast<void>(client_.get_removed(crossed)); }),
              HasSubstr("cross"));
  EXPECT_THAT(refusal([&] { client_.restore_removed(static_cast<RemovalReason>(9), BoxRegion{}); }),
              HasSubstr("reason is 9"));
  BoxRegion upside_down;
  upside_down.box_map.min().z() = 5.0;
  upside_down.box_map.max().z() = -5.0;
  EXPECT_THAT(refusal([&] { client_.restore_removed(RemovalReason::moving, upside_down); }),
              HasSubstr("box z"));
  EXPECT_GT(client_.get_removed(BoxRegion{}).total, 0U);
}

/// A parked car and a wall, at places that no scan of the room reaches.
SavedMap far_places(std::span<const double> places_x_m) {
  StaticMap map{StaticMapConfig{}};
  LabelledScan scan;
  for (const auto& [y, label, motion] :
       {std::tuple(5.0F, SemanticClass::car, Motion::semi_static),
        std::tuple(-5.0F, SemanticClass::building, Motion::stationary)}) {
    for (int i = 0; i < 20; ++i) {
      scan.scan.points_lidar.emplace_back(5.0F, y, 0.05F * static_cast<float>(i));
      scan.labels.classes.push_back(label);
      scan.labels.confidence.push_back(1.0F);
      scan.motion.push_back(motion);
    }
  }
  for (const double x_m : places_x_m) {
    map.insert(scan, Eigen::Isometry3d(Eigen::Translation3d(x_m, 0.0, 0.0)));
  }
  return to_saved_map(map.checkpoint(CheckpointScope::everything));
}

TEST(RemovedOnDisk, ATileThatCannotBeReadLosesItselfAlone) {
  const ServiceSetup setup("every", "memory_limit_mib: 64");
  constexpr std::array places_x_m{1000.0, 2000.0, 3000.0};
  const SavedMap map = far_places(places_x_m);
  open_map_file(setup.map_file())->save(map);
  // Of the car at 2,000 m, and of the wall at 3,000 m.
  {
    SQLite::Database database(setup.map_file().string(), SQLite::OPEN_READWRITE);
    EXPECT_EQ(database.exec("UPDATE memories SET encoded = x'00' WHERE x = 100 AND y = 0"), 1);
    EXPECT_EQ(database.exec("UPDATE tiles SET encoded = x'00' WHERE x = 150 AND y = -1"), 1);
  }
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);

  const RemovedVoxels removed = client.get_removed(BoxRegion{});
  EXPECT_THAT(removed.incomplete, HasSubstr("2 of the tiles cannot be read"));
  EXPECT_THAT(removed.incomplete, HasSubstr("(100, 0)"));
  std::set<int> kilometres;
  for (const RemovedVoxel& voxel : removed.voxels) {
    kilometres.insert(static_cast<int>(voxel.position_map.x() / 1000.0F));
  }
  EXPECT_THAT(kilometres, ElementsAre(1, 3));
  const BoxRegion there{{Eigen::Vector3d(2000, 0, -10), Eigen::Vector3d(2019, 19, 10)}};
  EXPECT_THAT(refusal([&] { static_cast<void>(client.get_removed(there)); }),
              HasSubstr("(100, 0)"));

  std::vector<TileId> ids;
  for (const auto& tile : map.view.tiles) ids.push_back(tile->info.id);
  const TileSet tiles = client.get_tiles(ids);
  EXPECT_EQ(tiles.tiles.size(), ids.size() - 1);
  EXPECT_THAT(tiles.unreadable, ElementsAre(TileId{150, -1}));
  EXPECT_FALSE(tiles.fault.empty());
  EXPECT_THAT(refusal([&] { static_cast<void>(client.get_map()); }), HasSubstr("(150, -1)"));
  // It must not keep those waiting who plan elsewhere.
  stillmap::TileMirror mirror;
  const Subscription subscription = client.subscribe_region(
      BoxRegion{}, [&](const RegionUpdate& update) { mirror.apply(update); });
  EXPECT_THAT(wait_for_whole_map(client, mirror, patience), ElementsAre(TileId{150, -1}));
  EXPECT_EQ(mirror.snapshot()->tiles.size(), ids.size() - 1);
}

TEST(RemovedOnDisk, ADiskThatFailsIsGivenUpSoon) {
  const ServiceSetup setup("every", "memory_limit_mib: 64");
  std::vector<double> places_x_m(20);
  std::ranges::generate(places_x_m, [x_m = 0.0]() mutable { return x_m += 1000.0; });
  open_map_file(setup.map_file())->save(far_places(places_x_m));
  SQLite::Database(setup.map_file().string(), SQLite::OPEN_READWRITE)
      .exec("UPDATE memories SET encoded = x'00'");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  EXPECT_THAT(refusal([&] { static_cast<void>(client.get_removed(BoxRegion{})); }),
              HasSubstr("at least 8 of the tiles cannot be read"));
}

}  // namespace
}  // namespace stillmap::test
