#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <stdexcept>

#include "core/lidar/range_image_view.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "tests/map/map_worlds.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

/// Drives along x and back, twelve metres a scan, with a car that stands at every hundredth metre
/// on the way out and is gone on the way back.
class Drive {
 public:
  static constexpr int scans = 160;

  explicit Drive(StaticMap& map, double start_m = 0.0) : map_(map), start_m_(start_m) {}

  [[nodiscard]] static double x_of(int scan) {
    return 12.0 * (scan < scans / 2 ? scan : scans - 1 - scan);
  }
  void see(int scan) {
    LabelledScan seen = test::street_scan(static_cast<std::uint32_t>(scan % 5), 60);
    seen.scan.stamp_ns = scan + 1;
    const bool is_way_out = scan < scans / 2;
    for (int i = 0; i < 20; ++i) {
      const float x = 4.0F + 0.1F * static_cast<float>(i);
      if (is_way_out) {
        test::add_point(seen, {x, 2.0F, 0.3F}, SemanticClass::car, Motion::semi_static);
        test::add_point(seen, {x, 3.0F, 0.3F}, SemanticClass::car, Motion::highly_dynamic);
      }
    }
    const Isometry3d T_map_lidar(Eigen::Translation3d(start_m_ + x_of(scan), 0.0, 0.0));
    map_.insert(seen, T_map_lidar);
    map_.clear_seen_through(RangeImageView(seen.scan, {}, hdl_64e(), T_map_lidar),
                            seen.scan.stamp_ns);
  }

 private:
  StaticMap& map_;
  double start_m_;
};

/// A map in little memory, and its store.
class PagedMap {
 public:
  static constexpr std::size_t limit_bytes = 4'400'000;

  explicit PagedMap(std::unique_ptr<MapStore> store = open_scratch_map())
      : store_(std::move(store)) {
    map_.reset(7);
    map_.use_tile_store(store_->tile_store());
  }
  void drive(double start_m = 0.0) {
    Drive drive(map_, start_m);
    for (int scan = 0; scan < Drive::scans; ++scan) {
      drive.see(scan);
      if (scan % 4 != 3) continue;
      const MapCheckpoint checkpoint = map_.checkpoint();
      store_->save(to_saved_map(checkpoint));
      map_.checkpoint_stored(checkpoint.step);
      evicted_ += map_.evict(Vector3d(start_m + Drive::x_of(scan), 0.0, 0.0), limit_bytes);
      peak_bytes_ = std::max(peak_bytes_, map_.memory_use().bytes);
    }
  }
  /// Everything, whether in memory or not.
  [[nodiscard]] SavedMap whole() {
    store_->save(to_saved_map(map_.checkpoint()));
    return store_->load();
  }

  StaticMap map_{StaticMapConfig{}};
  std::unique_ptr<MapStore> store_;
  std::size_t evicted_ = 0;
  std::size_t peak_bytes_ = 0;
};

using Key = std::pair<TileId, VoxelIndex>;

std::map<Key, Voxel> voxels_of(const MapSnapshot& view) {
  std::map<Key, Voxel> voxels;
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) voxels[{tile->info.id, voxel.index}] = voxel;
  }
  return voxels;
}

std::multiset<std::tuple<int, float, float, float>> places(const std::vector<RemovedVoxel>& all) {
  std::multiset<std::tuple<int, float, float, float>> places;
  for (const RemovedVoxel& voxel : all) {
    const Eigen::Vector3f p = (voxel.position_map * 100.0F).array().round();
    places.emplace(static_cast<int>(voxel.reason), p.x(), p.y(), p.z());
  }
  return places;
}

/// Of tiles in memory and of those in the store.
std::vector<RemovedVoxel> removed_everywhere(const StaticMap& map, TileStore& store) {
  StaticMap::RemovedVoxels all = map.removed(test::everywhere(), map.tiles_in(test::everywhere()));
  for (const TileId id : all.non_resident) {
    const TileRecord record = store.load(id);
    if (record.evidence == nullptr) continue;
    const StaticMapConfig& config = map.config();
    std::ranges::copy(removed_voxels(*record.evidence, config.voxel_size_m, config.tile_size_m),
                      std::back_inserter(all.voxels));
  }
  return all.voxels;
}

TEST(MapPaging, AMapThatDoesNotFitBecomesTheSameMap) {
  StaticMap plain{StaticMapConfig{}};
  plain.reset(7);
  Drive drive(plain);
  for (int scan = 0; scan < Drive::scans; ++scan) drive.see(scan);
  PagedMap paged;
  paged.drive();
  ASSERT_GT(paged.evicted_, 50U);

  const auto expected = voxels_of(*plain.view());
  const SavedMap stored = paged.whole();
  const auto got = voxels_of(stored.view);
  ASSERT_EQ(got.size(), expected.size());
  for (const auto& [key, voxel] : expected) {
    const auto other = got.find(key);
    ASSERT_NE(other, got.end());
    EXPECT_EQ(other->second.point_count, voxel.point_count);
    EXPECT_EQ(other->second.evidence, voxel.evidence);
    EXPECT_EQ(other->second.mean_map, voxel.mean_map) << "also far from the origin, exactly";
    EXPECT_EQ(other->second.first_seen_ns, voxel.first_seen_ns);
    EXPECT_EQ(other->second.last_seen_ns, voxel.last_seen_ns);
  }
  const auto removed =
      places(plain.removed(test::everywhere(), plain.tiles_in(test::everywhere())).voxels);
  EXPECT_GT(removed.size(), 500U);
  EXPECT_EQ(places(removed_everywhere(paged.map_, *paged.store_->tile_store())), removed);
}

TEST(MapPaging, MemoryStaysBelowTheLimitOnADriveThatNeedsManyTimesIt) {
  StaticMap plain{StaticMapConfig{}};
  Drive drive(plain);
  for (int scan = 0; scan < Drive::scans; ++scan) drive.see(scan);
  ASSERT_GT(plain.memory_use().bytes, 3 * PagedMap::limit_bytes);
  PagedMap paged;
  paged.drive();
  EXPECT_LE(paged.peak_bytes_, PagedMap::limit_bytes);
}

TEST(MapPaging, FarFromTheOriginWhereFloatsAreCoarseTheFileStaysReadable) {
  PagedMap paged;
  paged.drive(60'000.0);
  ASSERT_GT(paged.evicted_, 50U);
  EXPECT_NO_THROW(static_cast<void>(paged.whole()));
}

TEST(MapPaging, AMapThatIsShownByOtherRulesIsStoredAsItIsShown) {
  const auto store = open_scratch_map();
  StaticMap before{StaticMapConfig{}};
  Drive(before).see(0);
  store->save(to_saved_map(before.checkpoint()));
  StaticMapConfig stricter;
  stricter.min_points = 5;
  StaticMap after{stricter};
  const SavedMap stored = store->load();
  after.resume(stored.view, stored.tile_evidence);
  store->save(to_saved_map(after.checkpoint(CheckpointScope::everything)));
  EXPECT_LT(voxels_of(store->load().view).size(), voxels_of(stored.view).size());
}

TEST(MapPaging, ViewsNameEveryTileAndSayWhichAreAway) {
  PagedMap paged;
  paged.drive();
  const auto view = paged.map_.view();
  const auto away =
      std::ranges::count_if(view->tiles, [](const auto& t) { return is_non_resident(*t); });
  EXPECT_GT(away, 10);
  EXPECT_EQ(view->tiles.size(), paged.whole().view.tiles.size());
}

TEST(MapPaging, TilesThatAreNotStoredYetStay) {
  PagedMap paged;
  Drive drive(paged.map_);
  for (int scan = 0; scan < Drive::scans / 2; ++scan) drive.see(scan);
  EXPECT_EQ(paged.map_.evict(Vector3d::Zero(), 0), 0U);
}

TEST(MapPaging, ARestartGoesOnWithWhatWasHidden) {
  const ScratchFolder folder;
  PagedMap before(open_map_file(folder / "map.stillmap"));
  before.drive();
  static_cast<void>(before.whole());
  const auto removed = places(removed_everywhere(before.map_, *before.store_->tile_store()));

  const auto store = open_map_file(folder / "map.stillmap");
  StaticMap after{StaticMapConfig{}};
  after.use_tile_store(store->tile_store());
  const SavedMap non_resident = store->load_non_resident();
  after.resume(non_resident.view, non_resident.tile_evidence);
  EXPECT_EQ(after.memory_use().resident_tiles, 0U);
  EXPECT_EQ(places(removed_everywhere(after, *store->tile_store())), removed);
  after.reload_near(Vector3d::Zero());
  EXPECT_LE(after.memory_use().bytes, PagedMap::limit_bytes);
  EXPECT_GT(after.memory_use().resident_tiles, 5U);
  EXPECT_EQ(after.view()->tiles.size(), non_resident.view.tiles.size());
  EXPECT_GT(after
                .restore_removed(RemovalReason::moving, test::everywhere(),
                                 after.tiles_in(test::everywhere()))
                .count,
            100U);
}

TEST(MapPaging, RestoringInPartsKeepsToTheLimit) {
  const ScratchFolder folder;
  PagedMap map(open_map_file(folder / "map.stillmap"));
  map.drive();
  ASSERT_GT(map.evicted_, 50U);
  const auto removed = places(removed_everywhere(map.map_, *map.store_->tile_store()));
  const auto is_moving = [](const auto& place) {
    return std::get<0>(place) == static_cast<int>(RemovalReason::moving);
  };
  const std::vector<TileId> ids = map.map_.tiles_in(test::everywhere());
  std::size_t restored = 0;
  std::size_t peak_bytes = 0;
  for (std::span<const TileId> left(ids); !left.empty();) {
    const auto some = left.first(std::min<std::size_t>(left.size(), 8));
    left = left.subspan(some.size());
    restored += map.map_.restore_removed(RemovalReason::moving, test::everywhere(), some).count;
    peak_bytes = std::max(peak_bytes, map.map_.memory_use().bytes);
    if (map.map_.memory_use().bytes < PagedMap::limit_bytes) continue;
    const MapCheckpoint checkpoint = map.map_.checkpoint();
    map.store_->save(to_saved_map(checkpoint));
    map.map_.checkpoint_stored(checkpoint.step);
    EXPECT_GT(map.map_.evict(Vector3d::Zero(), PagedMap::limit_bytes), 0U);
  }
  EXPECT_EQ(restored, std::ranges::count_if(removed, is_moving));
  // By the tiles of one part.
  EXPECT_LE(peak_bytes, PagedMap::limit_bytes + PagedMap::limit_bytes / 2);
}

/// Has lost one tile.
class FaultyTileStore : public TileStore {
 public:
  FaultyTileStore(std::shared_ptr<TileStore> sound, TileId lost)
      : sound_(std::move(sound)), lost_(lost) {}
  TileRecord load(TileId id) override {
    if (id == lost_) ++attempts_;
    if (id == lost_ && !is_mended_) throw std::runtime_error("the disk is broken");
    return sound_->load(id);
  }
  [[nodiscard]] int attempts() const { return attempts_; }
  void mend() { is_mended_ = true; }

 private:
  std::shared_ptr<TileStore> sound_;
  TileId lost_;
  int attempts_ = 0;
  bool is_mended_ = false;
};

TEST(MapPaging, ATileThatCannotBeReadStaysAsItIsStored) {
  const ScratchFolder folder;
  PagedMap before(open_map_file(folder / "map.stillmap"));
  before.drive();
  const SavedMap whole = before.whole();

  const auto store = open_map_file(folder / "map.stillmap");
  StaticMap after{StaticMapConfig{}};
  const auto faulty = std::make_shared<FaultyTileStore>(store->tile_store(), TileId{2, 0});
  after.use_tile_store(faulty);
  const SavedMap non_resident = store->load_non_resident();
  after.resume(non_resident.view, non_resident.tile_evidence);
  Drive drive(after);
  for (int scan = 0; scan < 10; ++scan) drive.see(scan);
  EXPECT_THAT(after.unreadable_tiles(), testing::ElementsAre("tile (2, 0): the disk is broken"));
  EXPECT_EQ(faulty->attempts(), 1) << "an attempt may take a broken disk long";
  store->save(to_saved_map(after.checkpoint()));
  const auto tile_of = [](const SavedMap& map) {
    return *std::ranges::find(map.view.tiles, TileId{2, 0},
                              [](const auto& tile) { return tile->info.id; });
  };
  EXPECT_EQ(tile_of(store->load())->info.content_hash, tile_of(whole)->info.content_hash);
  // Who asks for it is told.
  const auto restored = after.restore_removed(RemovalReason::moving, test::everywhere(),
                                              after.tiles_in(test::everywhere()));
  EXPECT_THAT(restored.unreadable, testing::ElementsAre(TileId{2, 0}));
  EXPECT_EQ(faulty->attempts(), 2);
  // A disk that recovers is noticed.
  faulty->mend();
  for (int scan = 0; scan < 30; ++scan) drive.see(scan % 10);
  EXPECT_THAT(after.unreadable_tiles(), testing::IsEmpty());
}

TEST(MapPaging, AFileOfTheFirstFormatIsReadAndUpgradedByTheFirstSave) {
  const ScratchFolder folder;
  const auto file = folder / "old.stillmap";
  StaticMap map = test::street_map(3, 100);
  const SavedMap stored{*map.view(), {}, {}, {{"sensor", "HDL-64E"}}};
  open_map_file(file)->save(stored);
  {
    SQLite::Database database(file.string(), SQLite::OPEN_READWRITE);
    database.exec("CREATE TABLE t AS SELECT x, y, revision, content_hash, encoded FROM tiles");
    database.exec("DROP TABLE tiles; DROP TABLE memories");
    database.exec(
        "CREATE TABLE tiles (x INTEGER NOT NULL, y INTEGER NOT NULL, revision INTEGER NOT NULL, "
        "content_hash INTEGER NOT NULL, encoded BLOB NOT NULL, PRIMARY KEY (x, y))");
    database.exec("INSERT INTO tiles SELECT * FROM t; DROP TABLE t; PRAGMA user_version = 1");
  }
  const auto store = open_map_file(file);
  EXPECT_EQ(voxels_of(store->load().view).size(), voxels_of(stored.view).size());
  const SavedMap non_resident = store->load_non_resident();
  ASSERT_EQ(non_resident.view.tiles.size(), stored.view.tiles.size());
  for (std::size_t i = 0; i < stored.view.tiles.size(); ++i) {
    EXPECT_EQ(non_resident.view.tiles[i]->info.voxel_count, stored.view.tiles[i]->info.voxel_count);
    EXPECT_TRUE(non_resident.view.tiles[i]->info.bounds_map.isApprox(
        stored.view.tiles[i]->info.bounds_map, 1e-6F));
  }
  EXPECT_EQ(voxels_of(store->load().view).size(), voxels_of(stored.view).size());
}

TEST(MapPaging, ACopyHoldsEverything) {
  const ScratchFolder folder;
  PagedMap paged;
  paged.drive();
  const SavedMap whole = paged.whole();
  paged.store_->copy_to(folder / "copy.stillmap");
  const SavedMap copy = open_map_file(folder / "copy.stillmap")->load();
  EXPECT_EQ(voxels_of(copy.view).size(), voxels_of(whole.view).size());
  EXPECT_EQ(copy.tile_evidence.size(), whole.tile_evidence.size());
}

}  // namespace
}  // namespace stillmap
