#include <signal.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>

#include "core/map/storage/map_file.hpp"
#include "tests/clients/command_test.hpp"
#include "tests/clients/unusable_maps.hpp"

namespace stillmap::test {
namespace {

namespace fs = std::filesystem;

/// Two maps of one drive: of its first and its last part, which share some of the way.
class MergeCommandTest : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    simulate("yard", 130, " --seed 21");
    for (const auto& [name, part] :
         {std::pair<std::string, std::string>{"a", "--scans 90"}, {"b", "--start 30"}}) {
      const ProcessResult mapped = run("map " + path("yard") + " " + part + " --out " + path(name));
      ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
    }
  }
  [[nodiscard]] std::string map(const std::string& name) const {
    return path(name + "/map.stillmap");
  }
};

TEST_F(MergeCommandTest, PutsOneMapIntoTheOtherAndCanWithdrawIt) {
  const std::string a_before = content("a/map.stillmap"), b_before = content("b/map.stillmap");
  const ProcessResult merged =
      run("merge " + map("a") + " " + map("b") + " --out " + path("c.stillmap") + " --json");
  ASSERT_EQ(merged.exit_code, 0) << merged.err;
  const nlohmann::json report = nlohmann::json::parse(merged.out);
  EXPECT_GE(report.at("closures").size(), 2U);
  EXPECT_EQ(content("a/map.stillmap"), a_before);
  EXPECT_EQ(content("b/map.stillmap"), b_before);
  EXPECT_EQ(run("map-check " + path("c.stillmap")).exit_code, 0);

  // By one drive in one map: the poses of b in c are those of the scans in a.
  const SavedMap a = open_map_file(map("a"))->load(), c = open_map_file(path("c.stillmap"))->load();
  ASSERT_EQ(c.trajectory.size(), 90U + 100U);
  for (std::size_t scan = 30; scan < 90; ++scan) {
    const Eigen::Isometry3d off =
        a.trajectory[scan].T_map_lidar.inverse() * c.trajectory[90 + scan - 30].T_map_lidar;
    EXPECT_LT(off.translation().norm(), 0.1) << scan;
  }

  const ProcessResult sessions = run("sessions " + path("c.stillmap") + " --json");
  const nlohmann::json list = nlohmann::json::parse(sessions.out);
  ASSERT_EQ(list.size(), 2U);
  EXPECT_THAT(list[1].at("source"), HasSubstr(path("yard")));
  ASSERT_EQ(
      run("sessions " + path("c.stillmap") + " --withdraw 2 --out " + path("d.stillmap")).exit_code,
      0);
  EXPECT_THAT(run("map-diff --tolerance 0 " + map("a") + " " + path("d.stillmap")).out,
              HasSubstr("nothing changed"));
}

TEST_F(MergeCommandTest, NamesWhatItCannotMerge) {
  write_unusable_maps(folder_);
  SavedMap pathless = open_map_file(map("b"))->load();
  pathless.trajectory = {};
  open_map_file(folder_ / "pathless.stillmap")->save(pathless);
  // What a server saved before it mapped on, with the id of another start.
  SavedMap backup = open_map_file(map("a"))->load();
  backup.view.map_id += 1;
  backup.trajectory.truncate(60);
  open_map_file(folder_ / "backup.stillmap")->save(backup);
  // As where the first of its sessions is too short to be told.
  SavedMap later = open_map_file(map("b"))->load();
  later.view.map_id += 1;
  const Trajectory whole = later.trajectory.to_vector();
  later.trajectory = Trajectory(whole.begin() + 5, whole.end());
  open_map_file(folder_ / "later.stillmap")->save(later);
  write("there.stillmap", "something");
  for (const auto& [arguments, fault] : {
           std::pair{map("a") + " " + path("none.stillmap"), std::string("none.stillmap")},
           std::pair{path("text.stillmap") + " " + map("a"), std::string("text.stillmap")},
           std::pair{map("a") + " " + path("empty.stillmap"), std::string("is an empty map")},
           std::pair{map("a") + " " + path("pathless.stillmap"), std::string("has no path")},
           std::pair{map("a") + " " + path("coarse.stillmap"), std::string("voxels of 0.4 m")},
           std::pair{map("a") + " " + map("a"), std::string("has session 1")},
           std::pair{map("a") + " " + path("backup.stillmap"), std::string("has session 1")},
           std::pair{path("backup.stillmap") + " " + map("a"), std::string("has session 1")},
           std::pair{map("b") + " " + path("later.stillmap"), std::string("has session 1")},
           std::pair{path("later.stillmap") + " " + map("b"), std::string("has session 1")},
           std::pair{map("a") + " " + map("b") + " --config " + path("text.stillmap"),
                     std::string("text.stillmap")},
       }) {
    const ProcessResult refused = run("merge " + arguments + " --out " + path("c.stillmap"));
    EXPECT_EQ(refused.exit_code, 2) << arguments;
    EXPECT_THAT(refused.err, HasSubstr(fault)) << arguments;
    EXPECT_FALSE(exists("c.stillmap"));
  }
  const std::string both = "merge " + map("a") + " " + map("b") + " --out ";
  EXPECT_THAT(run(both + path("there.stillmap")).err, HasSubstr("exists already"));
  EXPECT_THAT(run(both + map("b") + " --force").err, HasSubstr("stay as they are"));
  const ProcessResult nowhere = run(both + path("none/c.stillmap"));
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("cannot be locked"));
  const ProcessResult folder = run(both + path("a") + " --force");
  EXPECT_EQ(folder.exit_code, 2);
  EXPECT_THAT(folder.err, HasSubstr("is not a file"));
}

TEST_F(MergeCommandTest, KeepsToItsOwnFilesAndIsAloneWithThem) {
  fs::create_directory(folder_ / "tmp");
  const fs::path other = folder_ / "c.stillmap.merged";
  fs::copy_file(map("b"), other);
  const std::string merge = "merge " + map("a") + " " + other.string() + " --out ";
  const std::string in_tmp = "env TMPDIR=" + path("tmp") + " " + stillmap_program() + " " + merge;
  BackgroundProcess first(in_tmp + path("c.stillmap"), folder_ / "log");
  ASSERT_TRUE(eventually([&] { return exists("c.stillmap.lock"); }));
  const ProcessResult second = run(merge + path("c.stillmap"));
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_THAT(second.err, HasSubstr("is in use by process"));
  EXPECT_EQ(first.wait(), 0) << content("log");
  EXPECT_EQ(content("c.stillmap.merged"), content("b/map.stillmap"));

  BackgroundProcess stopped(in_tmp + path("d.stillmap"), folder_ / "log");
  ASSERT_TRUE(eventually([&] { return !fs::is_empty(folder_ / "tmp"); }));
  stopped.send(SIGINT);
  EXPECT_EQ(stopped.wait(), -1) << "as by a signal that nobody waits for";
  EXPECT_TRUE(fs::is_empty(folder_ / "tmp"));
  EXPECT_FALSE(exists("d.stillmap"));
}

/// Kills runs of a command that writes `file`, each a little later after it began to.
class KilledMergeTest : public MergeCommandTest {
 protected:
  /// What such runs write, or left.
  [[nodiscard]] std::set<fs::path> unfinished(const std::string& file) const {
    std::set<fs::path> found;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      if (entry.path().filename().string().starts_with(file + ".new-")) found.insert(entry.path());
    }
    return found;
  }
  /// Runs it to its end, too.
  void kill_and_repeat(const std::string& arguments, const std::string& file,
                       std::size_t poses_when_done) const {
    const std::string before = content(file);
    for (int i = 0; i < 4; ++i) {
      const std::set<fs::path> left = unfinished(file);
      BackgroundProcess killed(stillmap_program() + " " + arguments, folder_ / "log");
      // One that is quick may be done before it is seen at work.
      ASSERT_TRUE(eventually([&] {
        return killed.has_ended() || !std::ranges::includes(left, unfinished(file));
      })) << content("log");
      std::this_thread::sleep_for(i * std::chrono::milliseconds(15));
      killed.send(SIGKILL);
      killed.wait();
      if (content(file) == before) continue;
      ASSERT_EQ(run("map-check " + path(file)).exit_code, 0) << i;
      EXPECT_EQ(open_map_file(path(file))->load().trajectory.size(), poses_when_done) << i;
    }
    const ProcessResult again = run(arguments);
    ASSERT_EQ(again.exit_code, 0) << again.err;
    EXPECT_EQ(open_map_file(path(file))->load().trajectory.size(), poses_when_done);
    EXPECT_TRUE(unfinished(file).empty()) << "what the killed ones left";
  }
};

TEST_F(KilledMergeTest, LeavesTheOldMapOrTheNewOneAndCanBeRunAgain) {
  const std::string a_before = content("a/map.stillmap"), b_before = content("b/map.stillmap");
  fs::copy_file(map("b"), path("c.stillmap"));
  kill_and_repeat("merge " + map("a") + " " + map("b") + " --force --out " + path("c.stillmap"),
                  "c.stillmap", 90 + 100);
  EXPECT_EQ(content("a/map.stillmap"), a_before);
  EXPECT_EQ(content("b/map.stillmap"), b_before);
  const std::string c_before = content("c.stillmap");
  kill_and_repeat(
      "sessions " + path("c.stillmap") + " --withdraw 2 --force --out " + path("d.stillmap"),
      "d.stillmap", 90);
  EXPECT_EQ(content("c.stillmap"), c_before);
}

}  // namespace
}  // namespace stillmap::test
