#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <random>

#include "tests/map/saved_maps.hpp"
#include "tests/scratch_folder.hpp"
#include "tests/slowdown.hpp"

namespace stillmap {
namespace {

constexpr int states = 12;

/// Runs in the child: saves one state after the other, and tells the number of each finished save
/// through the pipe, until killed.
[[noreturn]] void save_for_ever(const std::filesystem::path& file,
                                const std::vector<SavedMap>& maps, int pipe_end) {
  // A forked process has lost TBB's workers.
  const tbb::global_control alone(tbb::global_control::max_allowed_parallelism, 1);
  const auto store = open_map_file(file);
  for (int i = 0;; i = (i + 1) % states) {
    store->save(maps[static_cast<std::size_t>(i)]);
    if (write(pipe_end, &i, sizeof(i)) != sizeof(i)) _exit(1);
  }
}

/// Kills a saving process `delay_us` after it began, or after its first save; the last save that it
/// reported, -1 for none.
int last_save_before_kill(const std::filesystem::path& file, const std::vector<SavedMap>& maps,
                          useconds_t delay_us, bool after_a_save) {
  int ends[2] = {};
  EXPECT_EQ(pipe(ends), 0);
  const pid_t child = fork();
  if (child == 0) save_for_ever(file, maps, ends[1]);
  close(ends[1]);
  int last = -1;
  if (after_a_save) {
    EXPECT_EQ(read(ends[0], &last, sizeof(last)), static_cast<ssize_t>(sizeof(last)));
  }
  usleep(delay_us);
  kill(child, SIGKILL);
  int how = 0;
  waitpid(child, &how, 0);
  EXPECT_TRUE(WIFSIGNALED(how)) << "the child ended by itself";
  for (int i = 0; read(ends[0], &i, sizeof(i)) == sizeof(i);) last = i;
  close(ends[0]);
  return last;
}

TEST(MapFileCrash, KilledWhileSavingTheLastSaveOrTheNextOneIsThere) {
  const ScratchFolder folder;
  const std::filesystem::path file = folder / "city.stillmap";
  std::vector<SavedMap> maps;
  for (int i = 0; i < states; ++i) maps.push_back(test::saved_map(i));
  std::mt19937 random(4);
  std::uniform_int_distribution<useconds_t> delay_us(2'000, 150'000 * test::slowdown);
  int kills_after_a_save = 0;
  std::string before = "nothing";
  for (int kill_count = 0; kill_count < 20; ++kill_count) {
    const int last = last_save_before_kill(file, maps, delay_us(random), kill_count % 2 == 1);
    const SavedMap found = open_map_file(file)->load();
    const std::string seed = found.view.tiles.empty() ? "nothing" : found.metadata.at("seed");
    if (last < 0) {
      EXPECT_TRUE(seed == before || seed == "0") << seed;
    } else {
      ++kills_after_a_save;
      EXPECT_TRUE(seed == std::to_string(last) || seed == std::to_string((last + 1) % states))
          << "last finished save " << last << ", found " << seed;
    }
    if (seed != "nothing") {
      test::expect_equal(found, maps[static_cast<std::size_t>(std::stoi(seed))]);
    }
    before = seed;
  }
  EXPECT_GE(kills_after_a_save, 10);
}

}  // namespace
}  // namespace stillmap
