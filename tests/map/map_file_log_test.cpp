// A log ("-wal") that a crash left beside a map file, and what is copied over that file.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "core/map/map_id.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/map/storage/map_sessions.hpp"
#include "tests/map/saved_maps.hpp"
#include "tests/map/short_lock_patience.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

class MapFileLogTest : public testing::Test {
 protected:
  /// The file and its log as a crash leaves them between a save of `after` and the moment when the
  /// log is brought into the file.
  void crash_between(const SavedMap& before, const SavedMap& after) const {
    const fs::path live = folder_ / "live.stillmap";
    const auto store = open_map_file(live);
    store->save(before);
    SQLite::Database reader(live.string(), SQLite::OPEN_READONLY);
    reader.exec("BEGIN; SELECT count(*) FROM tiles");
    static_cast<void>(reader.execAndGet("SELECT count(*) FROM tiles").getInt());
    store->save(after);
    fs::copy_file(live, file_);
    fs::copy_file(live.string() + "-wal", log_);
    ASSERT_GT(fs::file_size(log_), 32U);
  }

  test::ShortLockPatience patience_;
  ScratchFolder folder_;
  fs::path file_ = folder_ / "city.stillmap";
  fs::path log_ = folder_ / "city.stillmap-wal";
};

TEST_F(MapFileLogTest, TheLogOfTheFileItselfIsBroughtIn) {
  crash_between(test::saved_map(1), test::saved_map(2));
  test::expect_equal(read_map_file(file_), test::saved_map(2));
  test::expect_equal(open_map_file(file_)->load(), test::saved_map(2));
}

TEST_F(MapFileLogTest, ABackupCopiedOverTheFileIsOpenedWithoutTheOldLog) {
  for (const int backup : {0, 7}) {
    open_map_file(folder_ / "backup.stillmap")->save(test::saved_map(backup));
    fs::remove(folder_ / "live.stillmap");
    fs::remove(file_);
    fs::remove(log_);
    crash_between(test::saved_map(1), test::saved_map(2));
    fs::copy_file(folder_ / "backup.stillmap", file_, fs::copy_options::overwrite_existing);
    test::expect_equal(read_map_file(file_), test::saved_map(backup));
    test::expect_equal(open_map_file(file_)->load(), test::saved_map(backup));
    EXPECT_TRUE(fs::exists(log_.string() + ".other")) << "nothing is thrown away";
  }
}

TEST_F(MapFileLogTest, AnOlderStateOfTheSameFileIsOpenedAsItIs) {
  open_map_file(file_)->save(test::saved_map(5));
  fs::copy_file(file_, folder_ / "backup.stillmap");
  open_map_file(file_)->save(test::saved_map(1));
  fs::rename(file_, folder_ / "live.stillmap");
  crash_between(test::saved_map(4), test::saved_map(2));
  fs::copy_file(folder_ / "backup.stillmap", file_, fs::copy_options::overwrite_existing);
  test::expect_equal(open_map_file(file_)->load(), test::saved_map(5));
}

TEST_F(MapFileLogTest, ALogInUseStaysWhereItIs) {
  const auto store = open_map_file(file_);
  store->save(test::saved_map(1));
  SQLite::Database reader(file_.string(), SQLite::OPEN_READONLY);
  reader.exec("BEGIN");
  static_cast<void>(reader.execAndGet("SELECT count(*) FROM tiles").getInt());
  store->save(test::saved_map(2));
  test::expect_equal(open_map_file(file_)->load(), test::saved_map(2));
  EXPECT_TRUE(fs::exists(log_));
}

TEST(MapFileReplace, TheOldMapGivesWayWithItsLog) {
  const ScratchFolder folder;
  const fs::path file = folder / "map.stillmap";
  const auto old = open_map_file(file);
  old->save(test::saved_map(1));
  open_map_file(folder / "new.stillmap")->save(test::saved_map(2));
  replace_map_file(folder / "new.stillmap", file);
  EXPECT_FALSE(fs::exists(folder / "new.stillmap"));
  test::expect_equal(open_map_file(file)->load(), test::saved_map(2));
}

TEST(MapId, IsAnotherOneEveryTime) {
  std::map<std::uint64_t, int> ids;
  for (int i = 0; i < 1000; ++i) ++ids[new_map_id()];
  EXPECT_EQ(ids.size(), 1000U);
  EXPECT_FALSE(ids.contains(0));
  EXPECT_LE(ids.rbegin()->first, UINT64_MAX >> 1);
}

TEST_F(MapFileLogTest, AWithdrawalIsOpenedWithoutTheLogOfItsOriginal) {
  const fs::path live = folder_ / "live.stillmap", withdrawn = folder_ / "withdrawn.stillmap";
  open_map_file(live)->save(test::saved_map(1));
  {
    const auto store = open_map_file(live);
    SavedMap map = store->load();
    store->begin_run(2, {.source = "test", .withdrawable = 2});
    SQLite::Database reader(live.string(), SQLite::OPEN_READONLY);
    reader.exec("BEGIN");
    static_cast<void>(reader.execAndGet("SELECT count(*) FROM tiles").getInt());
    map.view.map_id = 2;
    map.view.tiles = test::saved_map(2).view.tiles;
    map.tile_evidence = test::saved_map(2).tile_evidence;
    map.trajectory.push_back(map.trajectory.back());
    store->save(map);
    withdraw_newest_session(live, withdrawn);
    fs::copy_file(live.string() + "-wal", log_);
  }
  const SavedMap expected = read_map_file(withdrawn);
  fs::rename(withdrawn, file_);
  test::expect_equal(read_map_file(file_), expected);
  test::expect_equal(open_map_file(file_)->load(), expected);
  EXPECT_TRUE(fs::exists(log_.string() + ".other"));
}

TEST(MapFileFates, AFileAndALogThatAreWrittenOverTogetherAreAnothers) {
  const ScratchFolder folder;
  const fs::path file = folder / "map.stillmap", backup = folder / "backup.stillmap";
  const auto names = [](const fs::path& of) {
    return std::vector<fs::path>{of, of.string() + "-wal", of.string() + "-shm"};
  };
  const auto copy = [&](const fs::path& from, const fs::path& to) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::string content = content_of(names(from)[i]);
      std::ofstream(names(to)[i], std::ios::binary | std::ios::trunc) << content;
    }
  };
  const auto store = open_map_file(file);
  store->save(test::saved_map(1));
  copy(file, backup);
  store->save(test::saved_map(2));
  store->save(test::saved_map(3));
  ASSERT_EQ(store->fate(), MapFileFate::kept);
  copy(backup, file);
  EXPECT_THROW(store->save(test::saved_map(4)), MapFileError);
  EXPECT_EQ(store->fate(), MapFileFate::overwritten);
  store->abandon();
}

TEST(MapFileFates, WhatWasMadeAnewWithoutAMarkIsAnothers) {
  const ScratchFolder folder;
  const fs::path file = folder / "map.stillmap", copy = folder / "copy.stillmap";
  const auto store = open_map_file(file);
  store->save(test::saved_map(1));
  fs::copy_file(file, copy);
  SQLite::Database(copy.string(), SQLite::OPEN_READWRITE).exec("DELETE FROM trajectory; VACUUM");
  const std::string content = content_of(copy);
  std::ofstream(file, std::ios::binary | std::ios::trunc) << content;
  EXPECT_EQ(store->fate(), MapFileFate::overwritten);
  fs::rename(copy, file);
  EXPECT_EQ(store->fate(), MapFileFate::replaced);
  EXPECT_FALSE(store->is_same_under_name());
  store->abandon();
}

TEST(MapFileFates, APipeUnderItsNameIsNotWaitedFor) {
  const ScratchFolder folder;
  const fs::path file = folder / "map.stillmap";
  const auto store = open_map_file(file);
  store->save(test::saved_map(1));
  fs::remove(file);
  ASSERT_EQ(mkfifo(file.c_str(), 0600), 0);
  EXPECT_EQ(store->fate(), MapFileFate::replaced);
  EXPECT_FALSE(store->is_same_under_name());
}

TEST(MapFileFates, AReaderOfTilesThatClosesLastDoesNotBringAnAbandonedLogIn) {
  const test::ShortLockPatience patience;
  for (const bool is_abandoned : {true, false}) {
    const ScratchFolder folder;
    const fs::path file = folder / "map.stillmap", backup = folder / "backup.stillmap";
    open_map_file(backup)->save(test::saved_map(3));
    auto store = open_map_file(file);
    store->save(test::saved_map(1));
    auto tiles = store->tile_store();
    static_cast<void>(tiles->load({0, 0}));
    {
      SQLite::Database reader(file.string(), SQLite::OPEN_READONLY);
      reader.exec("BEGIN");
      static_cast<void>(reader.execAndGet("SELECT count(*) FROM tiles").getInt());
      store->save(test::saved_map(2));
    }
    ASSERT_GT(fs::file_size(file.string() + "-wal"), 32U);
    const std::string content = content_of(backup);
    if (is_abandoned) {
      std::ofstream(file, std::ios::binary | std::ios::trunc) << content;
      static_cast<void>(store->abandon());
    }
    store.reset();
    tiles.reset();
    if (is_abandoned) {
      EXPECT_EQ(content_of(file), content);
    } else {
      EXPECT_FALSE(fs::exists(file.string() + "-wal"));
      test::expect_equal(open_map_file(file)->load(), test::saved_map(2));
    }
  }
}

TEST(MapFileFates, AnUpgradeIsNoOthersWork) {
  const ScratchFolder folder;
  const fs::path file = folder / "map.stillmap";
  open_map_file(file)->save(test::saved_map(1));
  SQLite::Database(file.string(), SQLite::OPEN_READWRITE).exec("DROP INDEX tile_infos");
  const auto store = open_map_file(file);
  SavedMap map = store->load();
  store->begin_run(7, {});
  map.view.map_id = 7;
  store->save(map);
  EXPECT_EQ(store->fate(), MapFileFate::kept);
  SQLite::Database(file.string(), SQLite::OPEN_READWRITE).exec("DROP INDEX tile_infos");
  static_cast<void>(store->load_non_resident());
  EXPECT_EQ(store->fate(), MapFileFate::kept);
  store->save(map);
  EXPECT_EQ(store->fate(), MapFileFate::kept);
}

}  // namespace
}  // namespace stillmap
