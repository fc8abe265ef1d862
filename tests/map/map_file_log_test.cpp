// A log ("-wal") that a crash left beside a map file, and what is copied over that file.

#include <SQLiteCpp/SQLiteCpp.h>
#include <gmock/gmock.h>

#include <fstream>
#include <map>

#include "core/map/map_id.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "tests/map/saved_maps.hpp"
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

}  // namespace
}  // namespace stillmap
