#include "core/process/temporary_folder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

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

std::vector<std::string> names_in(const ScratchFolder& scratch) {
  std::vector<std::string> names;
  for (const auto& one : fs::directory_iterator(scratch.path()))
    names.push_back(one.path().filename().string());
  return names;
}

/// A process that has made a folder and waits to be killed.
class Owner {
 public:
  Owner(const fs::path& prefix, TemporaryFolder::OfTheDead of_the_dead) {
    std::array<int, 2> made{};
    if (pipe(made.data()) != 0) throw std::runtime_error("no pipe");
    process_ = fork();
    if (process_ == 0) {
      const TemporaryFolder folder(prefix, of_the_dead);
      std::ofstream(folder.path() / "map") << "a copy";
      static_cast<void>(!write(made[1], "!", 1));
      while (true) pause();
    }
    char told = 0;
    EXPECT_EQ(read(made[0], &told, 1), 1);
    for (const int end : made) close(end);
  }
  ~Owner() { end(); }
  Owner(const Owner&) = delete;
  Owner& operator=(const Owner&) = delete;

  void end() {
    if (process_ == 0) return;
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
    process_ = 0;
  }

 private:
  pid_t process_ = 0;
};

TEST(TemporaryFolderTest, CopiesOfKilledProcessesGoWithTheNextOneAndThoseOfTheLivingStay) {
  using enum TemporaryFolder::OfTheDead;
  const ScratchFolder scratch;
  Owner one(scratch / "read-", remove);
  Owner other(scratch / "read-", remove);
  const Owner whose_stays(scratch / "map.new-", keep);
  EXPECT_THAT(names_in(scratch), testing::SizeIs(3));
  one.end();
  {
    const TemporaryFolder own(scratch / "read-", remove);
    const TemporaryFolder second(scratch / "read-", remove);
    EXPECT_TRUE(fs::exists(own.path()));
    EXPECT_THAT(names_in(scratch), testing::SizeIs(4));
  }
  other.end();
  { const TemporaryFolder own(scratch / "read-", remove); }
  EXPECT_THAT(names_in(scratch), testing::ElementsAre(testing::StartsWith("map.new-")));
}

/// Between its making and its lock, others may remove it.
TEST(TemporaryFolderTest, ManyThatAreMadeAtOnceAreThere) {
  const ScratchFolder scratch;
  std::vector<pid_t> makers;
  for (int maker = 0; maker < 8; ++maker) {
    const pid_t process = fork();
    if (process != 0) {
      makers.push_back(process);
      continue;
    }
    bool are_there = true;
    for (int k = 0; k < 300; ++k) {
      const TemporaryFolder own(scratch / "read-", TemporaryFolder::OfTheDead::remove);
      are_there &= fs::exists(own.path());
    }
    _exit(are_there ? 0 : 1);
  }
  for (const pid_t maker : makers) {
    int status = -1;
    waitpid(maker, &status, 0);
    EXPECT_EQ(status, 0);
  }
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST(TemporaryFolderTest, NoneIsLeftThatCannotBeHeld) {
  const ScratchFolder scratch;
  const pid_t child = fork();
  if (child == 0) {
    const rlimit none{0, 0};
    setrlimit(RLIMIT_NOFILE, &none);
    try {
      const TemporaryFolder own(scratch / "read-", TemporaryFolder::OfTheDead::remove);
    } catch (const fs::filesystem_error& error) {
      _exit(error.code() == std::errc::too_many_files_open ? 0 : 1);
    }
    _exit(2);
  }
  int status = -1;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_TRUE(fs::is_empty(scratch.path()));
}

TEST(TemporaryFolderTest, CopiesWithoutALockStay) {
  const ScratchFolder scratch;
  // As earlier versions made them, and may use them now.
  fs::create_directory(scratch / "read-aB3xYz");
  // Somebody else's, in a folder for everybody.
  fs::create_directory(scratch / "away");
  fs::create_symlink(scratch / "away", scratch / "read-held-aB3xYz");
  { const TemporaryFolder own(scratch / "read-", TemporaryFolder::OfTheDead::remove); }
  EXPECT_THAT(names_in(scratch),
              testing::UnorderedElementsAre("read-aB3xYz", "away", "read-held-aB3xYz"));
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
