#include "core/map/storage/map_file.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <random>

#include "tests/map/saved_maps.hpp"
#include "tests/map/short_lock_patience.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using test::expect_equal;
using test::saved_map;
using testing::HasSubstr;

std::string bytes_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void write_bytes(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

class MapFileTest : public testing::Test {
 protected:
  /// Expects the file to be refused in words that hold `fault` and its name, and left as it is.
  void expect_refused(const std::string& fault) const {
    const std::string before = bytes_of(file_);
    const auto open_and_load = [&] { (void)open_map_file(file_)->load(); };
    EXPECT_THAT(open_and_load, testing::ThrowsMessage<MapFileError>(
                                   testing::AllOf(HasSubstr(fault), HasSubstr(file_.string()))));
    EXPECT_EQ(bytes_of(file_), before);
  }

  /// Runs SQL on the file, past the store.
  void alter(const std::string& sql) const {
    SQLite::Database(file_.string(), SQLite::OPEN_READWRITE).exec(sql);
  }

  ScratchFolder folder_;
  fs::path file_ = folder_ / "city.stillmap";
};

TEST_F(MapFileTest, NewFileHoldsAnEmptyMap) {
  const SavedMap map = open_map_file(file_)->load();
  EXPECT_TRUE(map.view.tiles.empty());
  EXPECT_TRUE(map.trajectory.empty());
  EXPECT_EQ(open_map_file(file_)->load().view.version, 0U);
}

TEST_F(MapFileTest, EmptyFileBecomesAMapFile) {
  write_bytes(file_, "");
  open_map_file(file_)->save(saved_map(1));
  expect_equal(open_map_file(file_)->load(), saved_map(1));
}

TEST_F(MapFileTest, LoadsWhatWasSavedLast) {
  const auto store = open_map_file(file_);
  for (const int seed : {1, 5, 2, 2, 0}) {
    store->save(saved_map(seed));
    expect_equal(store->load(), saved_map(seed));
    expect_equal(open_map_file(file_)->load(), saved_map(seed));
  }
  store->save(SavedMap{});
  expect_equal(store->load(), SavedMap{});
}

TEST_F(MapFileTest, WritesOnlyTilesThatChanged) {
  SavedMap map = saved_map(1);
  const auto store = open_map_file(file_);
  store->save(map);
  // A stored tile that the store believes unchanged stays as it is, even if it is not.
  alter("UPDATE tiles SET encoded = x'00'");
  auto changed = std::make_shared<Tile>(*map.view.tiles[0]);
  ++changed->info.revision;
  map.view.tiles.set(changed);
  map.view.tiles.erase(map.view.tiles.back()->info.id);
  store->save(map);
  SQLite::Database database(file_.string());
  EXPECT_EQ(database.execAndGet("SELECT count(*) FROM tiles").getUInt(), map.view.tiles.size());
  EXPECT_EQ(database.execAndGet("SELECT count(*) FROM tiles WHERE encoded <> x'00'").getInt(), 1);
}

TEST_F(MapFileTest, TheFileAloneIsTheWholeMapAfterEachSave) {
  const auto store = open_map_file(file_);
  store->save(saved_map(4));
  const fs::path copy = folder_ / "copy.stillmap";
  fs::copy_file(file_, copy);
  expect_equal(open_map_file(copy)->load(), saved_map(4));
}

TEST_F(MapFileTest, TwoStoresOnOneFileSeeEachOthersSaves) {
  const auto one = open_map_file(file_);
  const auto other = open_map_file(file_);
  one->save(saved_map(1));
  expect_equal(other->load(), saved_map(1));
  other->save(saved_map(2));
  expect_equal(one->load(), saved_map(2));
}

TEST_F(MapFileTest, RefusesWhatIsNoDatabase) {
  write_bytes(file_, "x");
  expect_refused("is not a map file");
  write_bytes(file_, std::string(5000, 'y'));
  expect_refused("is not a map file");
  write_bytes(file_, std::string("SQLite format 3\0", 16));
  expect_refused("is not a map file");
}

TEST_F(MapFileTest, RefusesAnotherProgramsDatabase) {
  {
    SQLite::Database database(file_.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    database.exec("CREATE TABLE photos (name TEXT)");
  }
  expect_refused("another program");
}

TEST_F(MapFileTest, RefusesANewerSchema) {
  open_map_file(file_)->save(saved_map(1));
  alter("PRAGMA user_version = 3");
  expect_refused("newer Stillmap (schema 3");
}

TEST_F(MapFileTest, RefusesATruncatedFile) {
  open_map_file(file_)->save(saved_map(1));
  const std::string whole = bytes_of(file_);
  for (const double share : {0.2, 0.5, 0.9, 0.999}) {
    write_bytes(file_, whole.substr(0, static_cast<std::size_t>(share * double(whole.size()))));
    expect_refused("damaged");
  }
}

TEST_F(MapFileTest, NeverTakesADamagedFileForAnotherMap) {
  open_map_file(file_)->save(saved_map(1));
  const std::string whole = bytes_of(file_);
  std::mt19937 random(2);
  int refused = 0;
  for (int i = 0; i < 60; ++i) {
    std::string damaged = whole;
    const std::size_t at = 100 + random() % (whole.size() - 140);
    for (std::size_t k = 0; k < 32; ++k) damaged[at + k] = static_cast<char>(random());
    write_bytes(file_, damaged);
    try {
      const SavedMap map = open_map_file(file_)->load();
      // Damage in unused space or in plain numbers is not seen; no tile may be a wrong one.
      for (const auto& tile : map.view.tiles) EXPECT_FALSE(tile->voxels.empty());
    } catch (const MapFileError&) {
      ++refused;
      EXPECT_EQ(bytes_of(file_), damaged);
    }
  }
  EXPECT_GT(refused, 10) << "of 60 places; many of a small file are unused";
}

TEST_F(MapFileTest, RefusesATileThatIsNotTheStoredOne) {
  open_map_file(file_)->save(saved_map(1));
  alter("UPDATE tiles SET content_hash = content_hash + 1");
  expect_refused("content hash");
}

TEST_F(MapFileTest, RefusesATileBeyondTheEndOfAnyMap) {
  open_map_file(file_)->save(saved_map(1));
  alter("UPDATE tiles SET x = 2147483647 WHERE rowid = (SELECT min(rowid) FROM tiles)");
  const auto store = open_map_file(file_);
  for (const auto load : {&MapStore::load, &MapStore::load_non_resident}) {
    EXPECT_THAT([&] { (void)((*store).*load)(); },
                testing::ThrowsMessage<MapFileError>(HasSubstr("farther out than any map")));
  }
}

TEST_F(MapFileTest, RefusesImpossibleSizes) {
  open_map_file(file_)->save(saved_map(1));
  alter("UPDATE map SET voxel_size_m = 0");
  expect_refused("voxels of 0");
}

TEST_F(MapFileTest, RefusesAFolderAndAMissingFolder) {
  EXPECT_THAT([&] { (void)open_map_file(folder_.path()); },
              testing::ThrowsMessage<UnusableMapFileError>(HasSubstr("is not a file")));
  EXPECT_THAT([&] { (void)open_map_file(folder_ / "no" / "such" / "map"); },
              testing::ThrowsMessage<MapFileError>(HasSubstr("must exist and be writable")));
}

/// A server is started again for it.
TEST_F(MapFileTest, WhatAnotherTryMayMendIsNotUnusable) {
  const test::ShortLockPatience patience;
  open_map_file(file_)->save(saved_map(1));
  SQLite::Database other(file_.string(), SQLite::OPEN_READWRITE);
  other.exec("PRAGMA locking_mode = EXCLUSIVE");
  other.exec("BEGIN EXCLUSIVE");
  for (const fs::path& file : {file_, folder_ / "no" / "such" / "map"}) {
    try {
      (void)open_map_file(file);
      ADD_FAILURE() << file << " was opened";
    } catch (const UnusableMapFileError& error) {
      ADD_FAILURE() << error.what();
    } catch (const MapFileError& error) {
      EXPECT_THAT(error.what(), HasSubstr("cannot be opened"));
    }
  }
}

TEST_F(MapFileTest, RefusesAReadOnlyFolder) {
  // Nobody, not even root, can make a file there.
  EXPECT_THAT([&] { (void)open_map_file("/proc/city.stillmap"); },
              testing::ThrowsMessage<MapFileError>(HasSubstr("must exist and be writable")));
}

TEST_F(MapFileTest, FileInAReadOnlyFolderIsRefusedAndLeftAlone) {
  if (geteuid() == 0) GTEST_SKIP() << "root may write in read-only folders";
  open_map_file(file_)->save(saved_map(1));
  fs::permissions(folder_.path(), fs::perms::owner_read | fs::perms::owner_exec);
  expect_refused("must exist and be writable");
  fs::permissions(folder_.path(), fs::perms::owner_all);
}

}  // namespace
}  // namespace stillmap
