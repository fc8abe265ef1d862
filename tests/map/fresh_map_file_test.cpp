#include "core/map/storage/fresh_map_file.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <set>

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_lock.hpp"
#include "tests/map/saved_maps.hpp"
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

TEST_F(FreshMapFileTest, WhatAKilledProcessLeftGoesWhenTheFileIsLocked) {
  for (const char* name : {"city.stillmap.new-letter", "city.stillmap.new-diary/a.txt",
                           "city.stillmap.new-backup/a.txt", "town.stillmap.new-1aB2cD/a.txt"}) {
    static_cast<void>(folder_.file(name, "mine"));
  }
  const std::set<std::string> before = names();
  die_while_writing();
  die_while_writing();
  ASSERT_EQ(names().size(), before.size() + 2);
  { const MapLock lock(file_); }
  EXPECT_EQ(names(), before);
  EXPECT_EQ(content_of(folder_ / "city.stillmap.new-backup/a.txt"), "mine");
}

TEST_F(FreshMapFileTest, AMapThatHasTheNameOfTheLockIsNoLock) {
  const fs::path other = folder_ / "city.stillmap.lock";
  open_map_file(other)->save(test::saved_map(1));
  EXPECT_THAT(message_of<MapFileError>([&] { const MapLock lock(file_); }),
              testing::AllOf(testing::StartsWith(file_.string()),
                             testing::HasSubstr(other.string() + " is something else")));
  test::expect_equal(open_map_file(other)->load(), test::saved_map(1));
}

TEST_F(FreshMapFileTest, WhatWasToLieBesideTheFileIsNamedAndStays) {
  const FreshMapFile own(file_), of_town(folder_ / "town.2026-05-31_142500.stillmap");
  const FreshMapFile dated(folder_ / "city.2026-05-31_142500.stillmap");
  for (const FreshMapFile* fresh : {&own, &of_town, &dated})
    open_map_file(fresh->path())->save(test::saved_map(1));
  static_cast<void>(folder_.file("city.1.stillmap.new-letter", "mine"));
  static_cast<void>(folder_.file("city.2.stillmap.new-backup/a.txt", "mine"));
  { const MapLock lock(file_); }
  EXPECT_FALSE(fs::exists(own.path()));
  EXPECT_EQ(fresh_files_beside(file_), std::vector<fs::path>{dated.path()});
}

}  // namespace
}  // namespace stillmap
