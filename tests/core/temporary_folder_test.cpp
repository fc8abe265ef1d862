#include "core/process/temporary_folder.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

TEST(TemporaryFolderTest, IsItsOwnAndGoesWithAllInIt) {
  const ScratchFolder scratch;
  {
    const TemporaryFolder one(scratch / "copy-");
    const TemporaryFolder other(scratch / "copy-");
    EXPECT_NE(one.path(), other.path());
    fs::create_directory(one.path() / "more");
    std::ofstream(one.path() / "more" / "text") << "text";
  }
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST(TemporaryFolderTest, NamesWhatCannotBeMade) {
  const ScratchFolder scratch;
  try {
    const TemporaryFolder folder(scratch / "no" / "copy-");
    FAIL() << "was made";
  } catch (const fs::filesystem_error& error) {
    EXPECT_EQ(error.path1().parent_path(), scratch / "no");
    EXPECT_EQ(error.code(), std::errc::no_such_file_or_directory);
  }
}

TEST(TemporaryFolderTest, AllOfAProcessCanBeRemovedBeforeItEnds) {
  const ScratchFolder scratch;
  const pid_t child = fork();
  if (child == 0) {
    const TemporaryFolder one(scratch / "copy-");
    const TemporaryFolder other(scratch / "map-");
    std::ofstream(one.path() / "text") << "text";
    TemporaryFolder::remove_all_at_end();
    _exit(0);
  }
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

}  // namespace
}  // namespace stillmap
