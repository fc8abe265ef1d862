#include "core/map/storage/fresh_map_file.hpp"

#include <SQLiteCpp/Backup.h>
#include <SQLiteCpp/Database.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <set>

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_lock.hpp"
#include "tests/map/saved_maps.hpp"
#include "tests/map/short_lock_patience.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

class FreshMapFileTest : public testing::Test {
 protected:
  [[nodiscard]] std::set<std::string> names() const {
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      names.insert(entry.path().filename());
    }
    return names;
  }
  /// What a process leaves that is killed while it writes the file.
  void die_while_writing() const {
    const pid_t child = fork();
    if (child == 0) {
      const FreshMapFile fresh(file_);
      std::ofstream(fresh.path()) << "half of a map";
      std::ofstream(fresh.path().string() + "-journal") << "the other half";
      _exit(0);
    }
    waitpid(child, nullptr, 0);
  }

  ScratchFolder folder_;
  fs::path file_ = folder_ / "city.stillmap";
};

TEST_F(FreshMapFileTest, WhatLiesBesideANewFileOrACopyStays) {
  const fs::path source = folder_ / "copy.stillmap.new";
  open_map_file(source)->save(test::saved_map(1));
  for (const char* name : {"city.stillmap.new", "city.stillmap.new-journal"}) {
    std::ofstream(folder_ / name) << "mine";
  }
  static_cast<void>(open_map_file(file_));
  open_map_file(source)->copy_to(folder_ / "copy.stillmap");
  EXPECT_EQ(content_of(folder_ / "city.stillmap.new"), "mine");
  EXPECT_EQ(content_of(folder_ / "city.stillmap.new-journal"), "mine");
  test::expect_equal(open_map_file(source)->load(), test::saved_map(1));
  test::expect_equal(open_map_file(folder_ / "copy.stillmap")->load(), test::saved_map(1));
  EXPECT_THAT(names(),
              ElementsAre("city.stillmap", "city.stillmap.new", "city.stillmap.new-journal",
                          "copy.stillmap", "copy.stillmap.new"));
}

TEST_F(FreshMapFileTest, TakesThePlaceOfWhatALinkLeadsTo) {
  const fs::path there = folder_ / "elsewhere";
  fs::create_directory(there);
  open_map_file(there / "city.stillmap")->save(test::saved_map(1));
  fs::create_symlink(there / "city.stillmap", file_);
  const fs::path source = folder_ / "new.stillmap";
  open_map_file(source)->save(test::saved_map(2));
  open_map_file(source)->copy_to(file_);
  EXPECT_TRUE(fs::is_symlink(file_));
  test::expect_equal(open_map_file(there / "city.stillmap")->load(), test::saved_map(2));
  const FreshMapFile fresh(file_);
  EXPECT_EQ(fresh.path().parent_path().parent_path(), fs::canonical(there));
  open_map_file(fresh.path())->save(test::saved_map(3));
  replace_map_file(fresh.path(), file_);
  EXPECT_TRUE(fs::is_symlink(file_));
  test::expect_equal(open_map_file(there / "city.stillmap")->load(), test::saved_map(3));
}

TEST_F(FreshMapFileTest, GoesWhereItDidNotTakeThePlace) {
  {
    const FreshMapFile fresh(file_);
    open_map_file(fresh.path())->save(test::saved_map(1));
    EXPECT_EQ(fresh.path().parent_path().parent_path(), folder_.path());
    EXPECT_EQ(names().size(), 1U);
  }
  EXPECT_TRUE(names().empty());
}

TEST_F(FreshMapFileTest, PartsThatAKilledProcessLeftGoWhereAFileHasTheName) {
  for (const char* name : {"city.stillmap.new-letter", "city.stillmap.new-diary/a.txt",
                           "city.stillmap.new-backup/a.txt", "town.stillmap.new-1aB2cD/a.txt"}) {
    static_cast<void>(folder_.file(name, "mine"));
  }
  std::set<std::string> before = names();
  die_while_writing();
  die_while_writing();
  ASSERT_EQ(names().size(), before.size() + 2);
  remove_useless_fresh_files(file_);
  EXPECT_EQ(names().size(), before.size() + 2) << "they may be all that is left of it";
  static_cast<void>(open_map_file(file_));
  remove_useless_fresh_files(file_);
  before.insert("city.stillmap");
  EXPECT_EQ(names(), before);
  EXPECT_EQ(content_of(folder_ / "city.stillmap.new-backup/a.txt"), "mine");
}

TEST_F(FreshMapFileTest, WhatSomebodyPutIntoTheFolderIsNotRemoved) {
  die_while_writing();
  ASSERT_EQ(left_fresh_files(file_).size(), 1U);
  const fs::path repaired =
      left_fresh_files(file_).front().path.string() + std::string(".recovered");
  open_map_file(repaired)->save(test::saved_map(1));
  static_cast<void>(open_map_file(file_));
  EXPECT_TRUE(left_fresh_files(file_).empty());
  remove_useless_fresh_files(file_);
  test::expect_equal(open_map_file(repaired)->load(), test::saved_map(1));
}

TEST_F(FreshMapFileTest, WhatCannotBeReadNowStays) {
  static_cast<void>(open_map_file(file_));
  const fs::path fresh = folder_ / "city.stillmap.new-1aB2cD/unfinished.stillmap";
  fs::create_directory(fresh.parent_path());
  fs::create_symlink(fresh, fresh);
  ASSERT_EQ(left_fresh_files(file_).size(), 1U);
  EXPECT_EQ(left_content(left_fresh_files(file_).front()), LeftContent::unreadable);
  remove_useless_fresh_files(file_);
  EXPECT_TRUE(fs::is_symlink(fresh));
  fs::remove(fresh);
  EXPECT_EQ(left_content(left_fresh_files(file_).front()), LeftContent::none);
}

TEST_F(FreshMapFileTest, WhatAnotherProgramHasLockedStays) {
  const test::ShortLockPatience patience;
  const FreshMapFile fresh(file_);
  open_map_file(fresh.path())->save(test::saved_map(1));
  SQLite::Database other(fresh.path().string(), SQLite::OPEN_READWRITE);
  other.exec("PRAGMA locking_mode = EXCLUSIVE; BEGIN EXCLUSIVE; DELETE FROM metadata");
  static_cast<void>(open_map_file(file_));
  // Waits as long as SQLite waits for a lock.
  remove_useless_fresh_files(file_);
  EXPECT_TRUE(fs::exists(fresh.path()));
}

/// `merge`: between its steps it is the map that another one is to be put into.
TEST_F(FreshMapFileTest, AMapThatWasToBeChangedFurtherIsNotTakenForWhole) {
  const FreshMapFile fresh(file_, FreshMapFile::Writing::in_steps);
  open_map_file(fresh.path())->save(test::saved_map(1));
  ASSERT_EQ(left_fresh_files(file_).size(), 1U);
  EXPECT_EQ(left_content(left_fresh_files(file_).front()), LeftContent::none);
  remove_useless_fresh_files(file_);
  EXPECT_TRUE(names().empty());
}

TEST_F(FreshMapFileTest, WhatWasKilledInItsFirstStepGoesWhole) {
  open_map_file(file_)->save(test::saved_map(1));
  const pid_t child = fork();
  if (child == 0) {
    const FreshMapFile fresh(folder_ / "both.stillmap", FreshMapFile::Writing::in_steps);
    const FreshMapFile copy(fresh.path());
    fs::copy_file(file_, copy.path());
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  ASSERT_EQ(left_fresh_files(folder_ / "both.stillmap").size(), 1U);
  const fs::path left = left_fresh_files(folder_ / "both.stillmap").front().path.parent_path();
  const fs::path copy = fs::directory_iterator(left)->path();
  // What somebody else put there is not removed.
  static_cast<void>(std::ofstream(copy / "mine") << "mine");
  remove_useless_fresh_files(folder_ / "both.stillmap");
  EXPECT_TRUE(fs::exists(copy / "mine"));
  fs::remove(copy / "mine");
  remove_useless_fresh_files(folder_ / "both.stillmap");
  EXPECT_THAT(names(), ElementsAre("city.stillmap"));
}

TEST_F(FreshMapFileTest, WhatHoldsNoMapGoes) {
  const FreshMapFile fresh(file_);
  static_cast<void>(open_map_file(fresh.path()));
  ASSERT_EQ(left_fresh_files(file_).size(), 1U);
  EXPECT_EQ(left_content(left_fresh_files(file_).front()), LeftContent::none);
  remove_useless_fresh_files(file_);
  EXPECT_TRUE(names().empty());
}

/// SQLite, asked to open it, would take all of it back.
TEST_F(FreshMapFileTest, ACopyThatWasCutOffIsAPart) {
  const fs::path source = folder_ / "source.stillmap";
  open_map_file(source)->save(test::saved_map(1));
  for (const bool is_finished : {false, true}) {
    const pid_t child = fork();
    if (child == 0) {
      const FreshMapFile fresh(file_);
      SQLite::Database from(source.string(), SQLite::OPEN_READONLY);
      SQLite::Database to(fresh.path().string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
      to.exec("PRAGMA cache_size = 4");
      SQLite::Backup copy(to, from);
      const int half = static_cast<int>(fs::file_size(source) / 2048);
      static_cast<void>(copy.executeStep(is_finished ? -1 : half));
      kill(getpid(), SIGKILL);
    }
    waitpid(child, nullptr, 0);
    const std::vector<LeftFreshFile> left = left_fresh_files(file_);
    ASSERT_EQ(left.size(), 1U);
    ASSERT_GT(fs::file_size(left.front().path), 0U);
    const std::string content = content_of(left.front().path);
    EXPECT_EQ(left_content(left.front()),
              is_finished ? LeftContent::whole : LeftContent::unfinished);
    EXPECT_EQ(content_of(left.front().path), content);
    remove_fresh_file(left.front());
  }
}

TEST_F(FreshMapFileTest, AMapThatHasTheNameOfTheLockIsNoLock) {
  const fs::path other = folder_ / "city.stillmap.lock";
  open_map_file(other)->save(test::saved_map(1));
  EXPECT_THAT(message_of<MapFileError>([&] { const MapLock lock(file_); }),
              testing::AllOf(testing::StartsWith(file_.string()),
                             testing::HasSubstr(other.string() + " is something else")));
  test::expect_equal(open_map_file(other)->load(), test::saved_map(1));
}

/// On a file system whose inode numbers change, and not where somebody copied the lock.
TEST_F(FreshMapFileTest, ALockThatIsLockedAndSaysItsOwnIsHeld) {
  const MapLock lock(file_);
  ASSERT_TRUE(lock.is_held());
  const std::string name = file_.string() + ".lock", own = content_of(name);
  fs::remove(name);
  EXPECT_FALSE(lock.is_held());
  std::ofstream(name) << own;
  EXPECT_FALSE(lock.is_held());
  const int descriptor = open(name.c_str(), O_RDWR);
  ASSERT_EQ(flock(descriptor, LOCK_EX), 0);
  EXPECT_TRUE(lock.is_held());
  std::ofstream(name) << own.substr(0, own.rfind(' ')) << " 1234";
  EXPECT_FALSE(lock.is_held()) << "another one of this process";
  close(descriptor);
}

TEST_F(FreshMapFileTest, WhatWasToLieBesideTheFileIsNamedAndStays) {
  const FreshMapFile own(file_), of_town(folder_ / "town.2026-05-31_142500.stillmap");
  const FreshMapFile dated(folder_ / "city.2026-05-31_142500.stillmap");
  // Names of other maps.
  const FreshMapFile of_north(folder_ / "city.north.stillmap");
  const FreshMapFile of_north_dated(folder_ / "city.north.2026-05-31_142500.stillmap");
  const FreshMapFile of_day(folder_ / "city.2026-05-31.stillmap");
  const FreshMapFile of_noon(folder_ / "city.2026-05-31_142500.noon.stillmap");
  for (const FreshMapFile* fresh : {&own, &of_town, &dated})
    open_map_file(fresh->path())->save(test::saved_map(1));
  static_cast<void>(folder_.file("city.1.stillmap.new-letter", "mine"));
  static_cast<void>(folder_.file("city.2.stillmap.new-backup/a.txt", "mine"));
  const std::vector<LeftFreshFile> left = left_fresh_files(file_);
  ASSERT_EQ(left.size(), 1U);
  EXPECT_EQ(left.front().path, own.path());
  EXPECT_EQ(left.front().name, file_);
  const std::vector<LeftFreshFile> beside = left_fresh_files_beside(file_);
  ASSERT_EQ(beside.size(), 1U);
  EXPECT_EQ(beside.front().path, dated.path());
  const FreshMapFile second(folder_ / "city.2026-05-31_142500.2.stillmap");
  EXPECT_EQ(left_fresh_files_beside(file_).size(), 2U);
  remove_useless_fresh_files(file_);
  EXPECT_EQ(left_content(left.front()), LeftContent::whole);
  ASSERT_TRUE(keep_fresh_file(left.front(), file_));
  test::expect_equal(open_map_file(file_)->load(), test::saved_map(1));
  EXPECT_FALSE(keep_fresh_file(beside.front(), file_));
  EXPECT_TRUE(fs::exists(dated.path()));
}

}  // namespace
}  // namespace stillmap
