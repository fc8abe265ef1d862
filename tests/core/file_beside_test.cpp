#include "core/process/file_beside.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

std::ptrdiff_t files_in(const ScratchFolder& folder) {
  return std::distance(fs::directory_iterator(folder.path()), {});
}

TEST(FileBesideTest, KeepsTheFileUntilTheNewOneGetsItsPlace) {
  const ScratchFolder folder;
  const fs::path file = folder.file("map.png", "before");
  {
    FileBeside beside(file);
    std::ofstream(beside.path()) << "after";
    EXPECT_EQ(content_of(file), "before");
    EXPECT_FALSE(beside.put_in_place());
  }
  EXPECT_EQ(content_of(file), "after");
  {
    const FileBeside beside(file);
    std::ofstream(beside.path()) << "a part";
  }
  EXPECT_EQ(content_of(file), "after");
  EXPECT_EQ(files_in(folder), 1);
}

TEST(FileBesideTest, WhatAKilledProcessWroteIsNotInItsPlaceAndIsWrittenOver) {
  const ScratchFolder folder;
  const fs::path file = folder.file("map.png", "before");
  const pid_t child = fork();
  if (child == 0) {
    const FileBeside beside(file);
    std::ofstream(beside.path()) << "a part that is longer";
    kill(getpid(), SIGKILL);
  }
  waitpid(child, nullptr, 0);
  EXPECT_EQ(content_of(file), "before");
  FileBeside beside(file);
  std::ofstream(beside.path(), std::ios::trunc) << "after";
  EXPECT_FALSE(beside.put_in_place());
  EXPECT_EQ(content_of(file), "after");
  EXPECT_EQ(files_in(folder), 1);
}

TEST(FileBesideTest, ReplacesWhatALinkLeadsTo) {
  const ScratchFolder folder;
  const fs::path file = folder.file("disk/map.png", "before");
  fs::create_symlink(file, folder / "link.png");
  FileBeside beside(folder / "link.png");
  std::ofstream(beside.path()) << "after";
  EXPECT_FALSE(beside.put_in_place());
  EXPECT_TRUE(fs::is_symlink(folder / "link.png"));
  EXPECT_EQ(content_of(file), "after");
}

TEST(FileBesideTest, IsTheFileItselfWhereThereIsNoBeside) {
  const ScratchFolder folder;
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  {
    FileBeside beside(folder / "pipe");
    EXPECT_EQ(beside.path(), folder / "pipe");
    EXPECT_FALSE(beside.put_in_place());
  }
  EXPECT_TRUE(fs::exists(folder / "pipe"));
  // No longer name may be given.
  const fs::path long_name = folder.file(std::string(250, 'x'), "before");
  {
    FileBeside beside(long_name);
    std::ofstream(beside.path(), std::ios::trunc) << "after";
    EXPECT_FALSE(beside.put_in_place());
  }
  EXPECT_EQ(content_of(long_name), "after");
}

TEST(FileBesideTest, KeepsThePermissionsOfTheFileBefore) {
  const ScratchFolder folder;
  const fs::path file = folder.file("map.png", "before");
  const fs::perms shared = fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read |
                           fs::perms::group_write;
  fs::permissions(file, shared);
  FileBeside beside(file);
  std::ofstream(beside.path()) << "after";
  EXPECT_FALSE(beside.put_in_place());
  EXPECT_EQ(content_of(file), "after");
  EXPECT_EQ(fs::status(file).permissions(), shared);
}

TEST(FileBesideTest, WhatIsNotOnesOwnBesideIsLeftAndInNobodysWay) {
  const ScratchFolder folder;
  fs::create_directory(folder / "new.png.unfinished");
  const fs::path foreign = folder.file("other.png.unfinished", "a part");
  const bool is_foreign = ::chown(foreign.c_str(), 12345, 12345) == 0;
  for (const char* const name : {"new.png", "other.png"}) {
    FileBeside beside(folder / name);
    std::ofstream(beside.path()) << "after";
    EXPECT_FALSE(beside.put_in_place());
    EXPECT_EQ(content_of(folder / name), "after");
  }
  EXPECT_TRUE(fs::is_directory(folder / "new.png.unfinished"));
  if (is_foreign) {
    EXPECT_EQ(content_of(foreign), "a part");
  }
  EXPECT_EQ(files_in(folder), is_foreign ? 4 : 3);
}

TEST(FileBesideTest, SaysWhyThereIsNoPlace) {
  const ScratchFolder folder;
  FileBeside beside(folder / "no" / "map.png");
  EXPECT_EQ(beside.put_in_place(), std::errc::no_such_file_or_directory);
}

}  // namespace
}  // namespace stillmap
