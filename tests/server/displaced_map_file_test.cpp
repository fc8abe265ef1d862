// A map file that somebody removes, or puts another one in the place of, while it is saved to: the
// running map is not lost, and what lies there now stays as it is.

#include "tests/server/displaced_map_file.hpp"

#include <gmock/gmock.h>
#include <sqlite3.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "core/map/storage/map_sessions.hpp"

namespace stillmap::server {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

TEST_F(DisplacedMapFile, AFileThatWasRemovedIsWrittenAnewWithWhatWasOnTheDiskAlone) {
  evict_all();
  ASSERT_EQ(map_.view()->tiles.non_resident_count(), 1U);
  for (const char* suffix : {"", "-wal", "-shm", ".lock"}) fs::remove(file_.string() + suffix);
  map_scan(50.0F);
  EXPECT_EQ(saver_.save_as(""), file_);
  EXPECT_THAT(tiles_in(file_), testing::ElementsAre(0, 2));
  EXPECT_TRUE(others().empty());
  EXPECT_TRUE(fs::exists(folder_ / "city.stillmap.lock"));
  // And the map is read from there.
  evict_all();
  EXPECT_EQ(saver_.tile_store()->load({0, 0}).tile->voxels.size(), 1U);
}

TEST_F(DisplacedMapFile, IsNoticedByTheCheckpointsOfARobotThatStands) {
  fs::rename(file_, folder_ / "backup.stillmap");
  saver_.save_if_changed();
  EXPECT_THAT(tiles_in(file_), testing::ElementsAre(0));
  EXPECT_EQ(displaced(), 1U);
  map_scan(50.0F);
  saver_.save_at_end();
  EXPECT_THAT(tiles_in(file_), testing::ElementsAre(0, 2));
  EXPECT_THAT(tiles_in(folder_ / "backup.stillmap"), testing::ElementsAre(0))
      << "it was moved away";
}

TEST_F(DisplacedMapFile, AFileThatWasPutBackStaysAndTheMapGoesOnBesideIt) {
  evict_all();
  const std::string content = content_of(folder_ / "backup.stillmap");
  put_back();
  map_scan(30.0F);
  const fs::path saved = saver_.save_as("");
  EXPECT_EQ(content_of(file_), content);
  ASSERT_EQ(others(), std::vector<fs::path>{saved});
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(0, 1));
  EXPECT_EQ(displaced(), 1U);
  map_scan(-10.0F);
  saver_.save_at_end();
  EXPECT_EQ(content_of(file_), content);
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(-1, 0, 1));
}

TEST_F(DisplacedMapFile, AContentThatWasCopiedOverItStaysAndTheMapGoesOnBesideIt) {
  map_scan(30.0F);
  const std::string content = content_of(folder_ / "backup.stillmap");
  copy_over();
  const fs::path saved = saver_.save_as("");
  EXPECT_EQ(content_of(file_), content);
  ASSERT_EQ(others(), std::vector<fs::path>{saved});
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(0, 1));
  map_scan(-10.0F);
  saver_.save_at_end();
  EXPECT_EQ(content_of(file_), content);
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(-1, 0, 1));
}

TEST_F(DisplacedMapFile, AnEarlierStateOfItselfThatIsCopiedOverItStays) {
  fs::copy_file(file_, folder_ / "backup.stillmap", fs::copy_options::overwrite_existing);
  map_scan(30.0F);
  saver_.save_if_changed();
  copy_over();
  const fs::path saved = saver_.save_as("");
  EXPECT_EQ(content_of(file_), content_of(folder_ / "backup.stillmap"));
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(0, 1));
}

TEST_F(DisplacedMapFile, OfADamagedFileTheMapInMemoryIsKept) {
  const fs::path saved = saved_after_damage();
  EXPECT_NE(saved, file_);
  EXPECT_EQ(content_of(file_), "no map");
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(2)) << "the rest was in the file alone";
  map_scan(-10.0F);
  saver_.save_at_end();
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(-1, 2));
}

TEST_F(DisplacedMapFile, ALoadOfItsNameOpensWhatLiesThereNow) {
  for (const bool is_copied : {false, true}) {
    if (is_copied) {
      save_other_map(folder_ / "backup.stillmap");
      copy_over();
    } else {
      put_back();
    }
    map_scan(30.0F);
    EXPECT_EQ(load(is_copied ? "" : "city.stillmap"), file_);
    EXPECT_EQ(latest_map_.view()->tiles.size(), 1U);
    EXPECT_EQ(latest_map_.view()->tiles.front()->info.id.x, 2);
  }
  // What was mapped until then is beside it.
  EXPECT_EQ(others().size(), 2U);
  map_scan(-10.0F);
  saver_.save_at_end();
  EXPECT_THAT(tiles_in(file_), testing::ElementsAre(-1, 2));
}

TEST_F(DisplacedMapFile, AContentThatIsCopiedOverItDuringASaveStays) {
  map_scan(30.0F);
  while_saving_ = [this] { copy_over(); };
  EXPECT_THROW(saver_.save_as(""), MapFileError);
  EXPECT_THAT(tiles_in(saver_.save_as("")), testing::ElementsAre(0, 1));
  EXPECT_EQ(content_of(file_), content_of(folder_ / "backup.stillmap"));
}

TEST_F(DisplacedMapFile, NamesDoNotGrowWithEveryTime) {
  std::size_t longest = 0;
  for (int time = 0; time < 3; ++time) {
    map_scan(30.0F);
    const fs::path current = saver_.save_as("");
    longest = std::max(longest, current.filename().string().size());
    std::ofstream(current, std::ios::binary | std::ios::trunc) << "no map";
  }
  EXPECT_LE(longest, std::string("city.2026-05-31_142500.2.stillmap").size());
}

TEST_F(DisplacedMapFile, AResetKeepsTheMapWhoseFileWasReplaced) {
  put_back();
  map_scan(30.0F);
  const NewMap begun =
      saver_.begin_anew(false, [this](auto id, const auto& tiles) { begin(id, tiles); });
  EXPECT_THAT(tiles_in(begun.kept_file), testing::ElementsAre(0, 1));
  EXPECT_THAT(tiles_in(file_), testing::ElementsAre(2));
}

TEST_F(DisplacedMapFile, AMapThatCannotBeWrittenAnewIsAFailureUntilItCan) {
  fs::rename(folder_.path(), folder_.path().string() + "-away");
  map_scan(30.0F);
  EXPECT_THROW(saver_.save_as(""), MapFileError);
  EXPECT_THAT(statistics_.last_save_failure(), HasSubstr("removed"));
  fs::create_directory(folder_.path());
  EXPECT_EQ(saver_.save_as(""), file_);
  EXPECT_THAT(tiles_in(file_), testing::ElementsAre(0, 1));
  EXPECT_EQ(statistics_.last_save_failure(), "");
  fs::remove_all(folder_.path().string() + "-away");
}

TEST_F(DisplacedMapFile, ANameThatCannotBeLookedAtIsAFailureAndNoRemoval) {
  const fs::path away = folder_.path().string() + "-away";
  fs::rename(folder_.path(), away);
  fs::create_directory_symlink(folder_.path(), folder_.path());
  map_scan(30.0F);
  EXPECT_THROW(saver_.save_if_changed(), MapFileError);
  EXPECT_THROW(saver_.save_at_end(), MapFileError);
  EXPECT_THAT(statistics_.last_save_failure(), HasSubstr("cannot be looked at"));
  EXPECT_EQ(failed_, 2) << "the mapper is to freeze a map that fills its memory";
  fs::remove(folder_.path());
  fs::rename(away, folder_.path());
  EXPECT_EQ(saver_.save_as(""), file_);
  EXPECT_EQ(displaced(), 0U);
  EXPECT_EQ(statistics_.last_save_failure(), "");
}

TEST_F(DisplacedMapFile, EachAttemptToWriteItAnewCountsOneFailure) {
  fs::rename(folder_.path(), folder_.path().string() + "-away");
  map_scan(30.0F);
  for (int attempt = 1; attempt <= 3; ++attempt) {
    EXPECT_THROW(saver_.save_if_changed(), MapFileError);
    EXPECT_EQ(failed_, attempt);
    EXPECT_EQ(statistics_.metrics().checkpoint_failures.Value(), attempt);
  }
  fs::rename(folder_.path().string() + "-away", folder_.path());
}

TEST_F(DisplacedMapFile, TheStatusSaysSoUntilTheOperatorLoads) {
  put_back();
  map_scan(30.0F);
  const fs::path saved = saver_.save_as("");
  map_scan(50.0F);
  saver_.save_if_changed();
  EXPECT_EQ(statistics_.last_save_failure(), "") << "it is saved";
  EXPECT_THAT(statistics_.map_displaced(), HasSubstr("saved to " + saved.string()));
  EXPECT_EQ(load(""), saved) << "its own last save";
  EXPECT_THAT(statistics_.map_displaced(), HasSubstr("saved to " + saved.string()));
  load("city.stillmap");
  EXPECT_EQ(statistics_.map_displaced(), "");
}

TEST_F(DisplacedMapFile, ATileThatWasLostAndMappedAnewStays) {
  const fs::path saved = saved_after_damage();
  map_scan(5.0F);
  map_scan(5.0F);
  saver_.save_as("");
  evict_all();
  map_scan(-10.0F);
  saver_.save_as("");
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(-1, 0, 2));
}

TEST_F(DisplacedMapFile, ATileOfAnotherMapDoesNotEnter) {
  evict_all();
  StaticMap other{StaticMapConfig()};
  other.reset(new_map_id());
  other.insert(scan_at(8.0F), Eigen::Isometry3d::Identity());
  fs::remove(folder_ / "backup.stillmap");
  open_map_file(folder_ / "backup.stillmap")
      ->save(to_saved_map(other.checkpoint(CheckpointScope::everything)));
  copy_over();
  // Before the next checkpoint looks.
  map_scan(5.0F);
  EXPECT_EQ(map_.view()->tiles.non_resident_count(), 1U);
  EXPECT_THAT(map_.unreadable_tiles(), testing::ElementsAre(HasSubstr("another one")));
}

TEST_F(DisplacedMapFile, ACopyOfItsLastStateIsItself) {
  for (const float x : {30.0F, 50.0F, -10.0F, -30.0F}) {
    fs::copy_file(file_, folder_ / "copy");
    fs::rename(folder_ / "copy", file_);
    map_scan(x);
    EXPECT_EQ(saver_.save_as(""), file_);
  }
  EXPECT_TRUE(others().empty());
  EXPECT_THAT(tiles_in(file_), testing::ElementsAre(-2, -1, 0, 1, 2));
}

TEST_F(DisplacedMapFile, ALoadWithoutANameIsOfTheLastSaveOnceAnotherMapBegan) {
  put_back();
  map_scan(30.0F);
  saver_.save_as("");
  saver_.begin_anew(false, [this](auto id, const auto& tiles) { begin(id, tiles); });
  map_scan(50.0F);
  const fs::path own = saver_.save_as("");
  EXPECT_EQ(load(""), own);
}

TEST_F(DisplacedMapFile, AHalfCopyIsNotWrittenToWhileALogIsInUse) {
  sqlite3* reader = nullptr;
  ASSERT_EQ(sqlite3_open(file_.c_str(), &reader), SQLITE_OK);
  sqlite3_exec(reader, "BEGIN; SELECT count(*) FROM tiles", nullptr, nullptr, nullptr);
  map_scan(30.0F);
  saver_.save_if_changed();
  ASSERT_GT(fs::file_size(file_.string() + "-wal"), 0U);
  const std::string content = content_of(folder_ / "backup.stillmap");
  const std::string half = content.substr(0, content.size() / 4);
  std::ofstream(file_, std::ios::binary | std::ios::trunc) << half;
  map_scan(50.0F);
  const fs::path saved = saver_.save_as("");
  EXPECT_NE(saved, file_);
  EXPECT_EQ(content_of(file_), half);
  sqlite3_exec(reader, "COMMIT", nullptr, nullptr, nullptr);
  sqlite3_close(reader);
}

TEST_F(DisplacedMapFile, WhatCannotBeDoneNowIsNoBadRequest) {
  EXPECT_THROW(saver_.save_as("backup.stillmap"), RefusedNow);
  std::ofstream(folder_ / "notes.txt") << "no map";
  EXPECT_THROW(saver_.save_as("notes.txt", true), RefusedNow);
  saver_.begin_anew(true, [this](auto id, const auto& tiles) { begin(id, tiles); });
  EXPECT_THROW(saver_.save_as("empty.stillmap"), RefusedNow);
  EXPECT_THROW(saver_.save_as("../city.stillmap"), std::invalid_argument);
}

TEST_F(DisplacedMapFile, OtherConnectionsOfStillmapAreNoStrangers) {
  map_scan(30.0F);
  saver_.save_if_changed();
  static_cast<void>(tiles_in(file_));
  map_scan(50.0F);
  EXPECT_EQ(saver_.save_as(""), file_);
  EXPECT_EQ(displaced(), 0U);
}

TEST_F(DisplacedMapFile, AWithdrawalOfItsSessionIsAnotherMap) {
  for (const bool is_copied : {false, true}) {
    for (const bool is_evicted : {false, true}) {
      load("city.stillmap");
      map_scan(30.0F);
      saver_.save_if_changed();
      map_.checkpoint_stored(step_);
      if (is_evicted) evict_all();
      fs::remove(folder_ / "backup.stillmap");
      withdraw_newest_session(file_, folder_ / "backup.stillmap");
      const std::string content = content_of(folder_ / "backup.stillmap");
      if (is_copied) {
        copy_over();
      } else {
        put_back();
      }
      map_scan(50.0F);
      const fs::path saved = saver_.save_as("");
      EXPECT_NE(saved, file_);
      EXPECT_EQ(content_of(file_), content);
      // After a load, a tile lies in the file alone until a scan reaches it.
      const std::vector<int> lost_with_file = is_evicted ? std::vector{2} : std::vector{1, 2};
      EXPECT_THAT(tiles_in(saved),
                  testing::ElementsAreArray(is_copied ? lost_with_file : std::vector{0, 1, 2}));
    }
  }
}

TEST_F(DisplacedMapFile, TilesThatAreLostAreNotServedAnyMore) {
  const std::uint64_t version = map_.view()->version;
  const fs::path saved = saved_after_damage();
  const auto view = latest_map_.view();
  ASSERT_EQ(view->tiles.size(), 1U) << "two were in the file alone";
  EXPECT_EQ(view->tiles.front()->info.id.x, 2);
  EXPECT_GT(view->version, version);
  EXPECT_EQ(map_.memory_use().non_resident_tiles, 0U);
  const auto history = latest_map_.state().history;
  EXPECT_EQ(history->removed.size(), 2U) << "clients that ask for changes are told";
  // What is mapped there anew is a tile as any other.
  map_scan(5.0F);
  EXPECT_EQ(latest_map_.view()->tiles.size(), 2U);
  EXPECT_TRUE(map_.unreadable_tiles().empty());
  saver_.save_as("");
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(0, 2));
}

TEST_F(DisplacedMapFile, WhatIsInMemoryAloneIsNotEvictedUntilItIsStored) {
  map_scan(30.0F);
  saver_.save_if_changed();
  evict_all();
  map_scan(5.0F);
  static_cast<void>(map_.checkpoint(CheckpointScope::everything));
  EXPECT_EQ(map_.forget_lost(), 1U);
  evict_all();
  EXPECT_EQ(map_.memory_use().resident_tiles, 1U);
}

TEST_F(DisplacedMapFile, OfAServerThatMappedNothingThereIsNothingToSave) {
  const fs::path empty = folder_ / "empty.stillmap";
  LatestMap nothing;
  nothing.begin(StaticMap(StaticMapConfig()).view(), {});
  Statistics statistics;
  MapSaver saver(nothing, statistics, empty, {}, {.memory_limit_mib = 64});
  saver.set_source(*this);
  fs::rename(folder_ / "backup.stillmap", empty);
  saver.save_if_changed();
  EXPECT_EQ(statistics.metrics().checkpoints_failing.Value(), 0.0);
  EXPECT_THAT(statistics.map_displaced(), HasSubstr(empty.string()));
  saver.save_at_end();
  for (const auto& entry : fs::directory_iterator(folder_.path())) {
    const std::string name = entry.path().filename().string();
    EXPECT_TRUE(!name.starts_with("empty.20") || name.ends_with(".lock")) << name;
  }
}

TEST_F(DisplacedMapFile, ALinkThatTookItsNameIsFollowed) {
  const ScratchFolder disk;
  const fs::path target = disk / "city.stillmap";
  fs::remove(file_);
  fs::create_symlink(target, file_);
  map_scan(30.0F);
  saver_.save_if_changed();
  EXPECT_EQ(saver_.save_as(""), target);
  EXPECT_TRUE(fs::is_symlink(file_));
  EXPECT_TRUE(others().empty());
  EXPECT_THROW(MapLock{target}, MapFileInUseError);
  EXPECT_EQ(statistics_.map_displaced(), "");
  saver_.save_at_end();
  EXPECT_THAT(tiles_in(target), testing::ElementsAre(0, 1));
}

TEST_F(DisplacedMapFile, WhereALinkLeadsNowhereTheMapGoesOnBesideIt) {
  fs::remove(file_);
  fs::create_symlink(folder_ / "unmounted" / "city.stillmap", file_);
  map_scan(30.0F);
  saver_.save_at_end();
  ASSERT_EQ(others().size(), 1U);
  EXPECT_THAT(tiles_in(others().front()), testing::ElementsAre(0, 1));
}

TEST_F(DisplacedMapFile, AFileThatWasMovedAndLinkedIsFollowedWithItsLock) {
  const ScratchFolder first, second;
  for (const bool is_copied : {false, true}) {
    const fs::path name = saver_.save_as("");
    const fs::path target = (is_copied ? second : first) / "city.stillmap";
    if (is_copied) {
      fs::copy_file(name, target);
      fs::remove(name);
    } else {
      fs::rename(name, target);
    }
    fs::create_symlink(target, name);
    map_scan(is_copied ? 50.0F : 30.0F);
    saver_.save_if_changed();
    EXPECT_EQ(saver_.save_as(""), target);
    EXPECT_THROW(MapLock{target}, MapFileInUseError);
    EXPECT_FALSE(fs::exists(name.string() + ".lock"));
    EXPECT_FALSE(fs::exists(name.string() + "-wal"));
    EXPECT_TRUE(others().empty());
    if (is_copied) {
      saver_.save_at_end();
      EXPECT_THAT(tiles_in(target), testing::ElementsAre(0, 1, 2));
      const NewMap begun =
          saver_.begin_anew(false, [this](auto id, const auto& tiles) { begin(id, tiles); });
      EXPECT_EQ(begun.kept_file.parent_path(), second.path());
    }
  }
}

TEST_F(DisplacedMapFile, ALockThatWasRemovedIsTakenAgainWhereItIsFree) {
  fs::remove(file_.string() + ".lock");
  saver_.save_if_changed();
  EXPECT_THROW(MapLock{file_}, MapFileInUseError);
  fs::remove(file_.string() + ".lock");
  const MapLock other(file_);
  map_scan(30.0F);
  const fs::path saved = saver_.save_as("");
  EXPECT_NE(saved, file_);
  EXPECT_THAT(tiles_in(saved), testing::ElementsAre(0, 1));
  EXPECT_THAT(tiles_in(file_), testing::ElementsAre(0));
}

TEST_F(DisplacedMapFile, AConfiguredLinkThatLeadsElsewhereIsTold) {
  const fs::path link = folder_ / "link.stillmap", target = folder_ / "linked.stillmap";
  fs::create_symlink(target, link);
  LatestMap nothing;
  nothing.begin(StaticMap(StaticMapConfig()).view(), {});
  Statistics statistics;
  MapSaver saver(nothing, statistics, link, {}, {.memory_limit_mib = 64});
  saver.set_source(*this);
  saver.save_if_changed();
  EXPECT_EQ(statistics.map_displaced(), "");
  fs::remove(link);
  fs::create_symlink(folder_ / "backup.stillmap", link);
  saver.save_if_changed();
  EXPECT_THAT(statistics.map_displaced(),
              HasSubstr("leads to " + (folder_ / "backup.stillmap").string()));
  EXPECT_EQ(displaced(), 0U);
  fs::remove(link);
  fs::create_symlink(target, link);
  saver.save_if_changed();
  EXPECT_EQ(statistics.map_displaced(), "");
}

TEST_F(DisplacedMapFile, WhatIsInMemoryStaysThereWhereItsFileIsGone) {
  map_scan(30.0F);
  saver_.save_if_changed();
  map_scan(50.0F);
  while_saving_ = [this] { copy_over(); };
  EXPECT_THROW(saver_.save_if_changed(), MapFileError);
  evict_all();
  EXPECT_EQ(map_.memory_use().non_resident_tiles, 0U);
  EXPECT_THAT(tiles_in(saver_.save_as("")), testing::ElementsAre(0, 1, 2));
}

TEST_F(DisplacedMapFile, ALoadWithoutANameFollowsALinkThatHasTheName) {
  const ScratchFolder disk;
  put_back();
  map_scan(30.0F);
  saver_.save_if_changed();
  fs::rename(file_, disk / "city.stillmap");
  fs::create_symlink(disk / "city.stillmap", file_);
  EXPECT_EQ(load(""), disk / "city.stillmap");
  EXPECT_EQ(statistics_.map_displaced(), "");
  const NewMap begun =
      saver_.begin_anew(false, [this](auto id, const auto& tiles) { begin(id, tiles); });
  EXPECT_EQ(begun.kept_file.parent_path(), disk.path());
  EXPECT_THAT(tiles_in(begun.kept_file), testing::ElementsAre(2));
  EXPECT_EQ(fs::read_symlink(file_), disk / "city.stillmap") << "the link is not renamed";
  EXPECT_TRUE(is_map_file(disk / "city.stillmap"));
  saver_.save_if_changed();
  EXPECT_EQ(statistics_.map_displaced(), "");
}

}  // namespace
}  // namespace stillmap::server
