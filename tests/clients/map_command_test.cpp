#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>

#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

class MapCommandTest : public CommandTest {
 protected:
  [[nodiscard]] ProcessResult map_city(const std::string& more = "") const {
    return run("map " + path("city") + " --out " + path("out") + " " + more);
  }
  void truncate(const std::string& name, std::uintmax_t bytes) const {
    std::filesystem::resize_file(folder_ / name, bytes);
  }
  /// Waits until the unfinished run has been saved more than the ten times, once a scan at most,
  /// from which on it is resumed. A save changes its file once or, as the clock ticks, twice.
  [[nodiscard]] bool has_enough_to_resume() const {
    std::set<std::filesystem::file_time_type> changes;
    const auto look = [&] {
      std::error_code missing;
      const auto time = last_write_time(folder_ / "out/unfinished/run.stillmap", missing);
      if (!missing) changes.insert(time);
      return changes.size() >= 24;
    };
    return eventually(look, patience, std::chrono::milliseconds(1));
  }
};

TEST_F(MapCommandTest, WritesPosesMapPicturesAndReport) {
  simulate("city");
  const ProcessResult result = map_city();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const char* file : {"poses_lidar.txt", "poses_tum.txt", "map.stillmap", "map.ply", "map.pcd",
                           "map.png", "trajectory.png", "trajectory_error.png", "report.json"}) {
    EXPECT_TRUE(exists(std::string("out/") + file)) << file;
  }
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 6U);
  EXPECT_THAT(result.out, AllOf(HasSubstr("6 scans"), HasSubstr("frame 'lidar'")));
}

TEST_F(MapCommandTest, GivesPosesOfTheRobotWhereTheLidarIsMounted) {
  const std::string mount = " --mount 1.2,0,1.4,0,15,0";
  ASSERT_EQ(run("simulate " + path("city") + " --preset yard --sensor vlp_16 --scans 8" + mount)
                .exit_code,
            0);
  const ProcessResult result = map_city("--json" + mount);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json report = nlohmann::json::parse(result.out);
  EXPECT_THAT(report.at("poses_frame"), HasSubstr("base_link"));
  EXPECT_LT(report.at("accuracy").at("ate_rmse_m"), 0.1);
  EXPECT_EQ(line_count("out/poses_base.txt"), 8U);
  EXPECT_THAT(content("out/poses_tum.txt"), HasSubstr("base_link"));

  // The same from a server's file.
  write("server.yaml",
        "sensor: vlp_16\nframes: {base: base_link}\n"
        "mount: {xyz_m: [1.2, 0, 1.4], rpy_deg: [0, 15, 0]}\n");
  const std::string poses = content("out/poses_base.txt");
  ASSERT_EQ(map_city("--force --config " + path("server.yaml")).exit_code, 0);
  EXPECT_EQ(content("out/poses_base.txt"), poses);

  write("server.yaml", "frames: {base: base_link}\nmount: {source: tf_static}\n");
  const ProcessResult refused = map_city("--force --config " + path("server.yaml"));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("/tf_static"), HasSubstr("--mount")));
}

TEST_F(MapCommandTest, ReportHoldsTimingMemoryAndAccuracy) {
  simulate("city");
  const ProcessResult result = map_city("--json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json report = nlohmann::json::parse(result.out);
  EXPECT_EQ(report, nlohmann::json::parse(content("out/report.json")));
  EXPECT_EQ(report.at("scans"), 6);
  EXPECT_EQ(report.at("label_source"), "stream");
  EXPECT_GT(report.at("median_ms"), 0.0);
  EXPECT_GE(report.at("p95_ms"), report.at("median_ms"));
  EXPECT_GT(report.at("stages").at("odometry").at("median_ms"), 0.0);
  EXPECT_GT(report.at("peak_memory_mb"), 1.0);
  EXPECT_GT(report.at("voxels"), 100);
  EXPECT_LT(report.at("accuracy").at("ate_rmse_m"), 0.5);
}

TEST_F(MapCommandTest, TakesThePartOfTheRecordingThatIsAskedFor) {
  simulate("city");
  ASSERT_EQ(map_city("--start 2 --scans 3 --labels none").exit_code, 0);
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 3U);
  EXPECT_EQ(nlohmann::json::parse(content("out/report.json")).at("label_source"), "none");
}

TEST_F(MapCommandTest, DoesNotWriteOverAMapUnlessForced) {
  simulate("city", 3);
  ASSERT_EQ(map_city().exit_code, 0);
  const std::string before = content("out/map.stillmap");
  const ProcessResult again = map_city("--scans 2");
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.err, AllOf(HasSubstr("map.stillmap"), HasSubstr("--force")));
  EXPECT_EQ(content("out/map.stillmap"), before);
  ASSERT_EQ(map_city("--scans 2 --force").exit_code, 0);
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 2U);
}

TEST_F(MapCommandTest, ANameThatIsNoTextCostsNoResults) {
  simulate("city", 3);
  const std::string out = path("caf\xE9");
  ASSERT_EQ(run("map " + path("city") + " --out " + out).exit_code, 0);
  EXPECT_TRUE(std::filesystem::exists(out + "/map.stillmap"));
  EXPECT_TRUE(nlohmann::json::accept(content("caf\xE9/report.json")));
}

TEST_F(MapCommandTest, ADamagedFirstScanIsSkippedAsAnyOther) {
  simulate("city", 4);
  ASSERT_EQ(run("map " + path("city") + " --out " + path("made")).exit_code, 0);
  std::filesystem::create_directory(folder_ / "clouds");
  for (const char* name : {"1.ply", "2.ply"})
    std::filesystem::copy_file(folder_ / "made/map.ply", folder_ / "clouds" / name);
  write("clouds/0.ply", "ply\nformat");
  const ProcessResult result = run("map " + path("clouds") + " --labels auto --out " + path("out"));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("skipped"));
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 2U);
}

TEST_F(MapCommandTest, AFaultyTruthIsSaidBeforeAnythingIsMapped) {
  simulate("city", 3);
  write("city/poses.txt", "1 0 0\n");
  const ProcessResult refused = map_city();
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("poses.txt"));
  EXPECT_FALSE(exists("out"));
}

// As SemanticKITTI's labels come with KITTI's own calib.txt of the cameras alone.
TEST_F(MapCommandTest, MapsWithoutAccuracyWhereThePosesAreThoseOfACameraSomewhere) {
  simulate("city");
  write("city/calib.txt", "P0: 718.856 0 607.1928 0 0 718.856 185.2157 0 0 0 1 0\n");
  const ProcessResult result = map_city("--json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err,
              AllOf(HasSubstr("without accuracy"), HasSubstr("calib.txt"), HasSubstr("\"Tr:\"")));
  EXPECT_TRUE(nlohmann::json::parse(result.out).at("accuracy").is_null());
  EXPECT_TRUE(exists("out/map.stillmap"));
  EXPECT_FALSE(exists("out/trajectory.png"));
}

TEST_F(MapCommandTest, ReplacesAllResultsOfAnEarlierRun) {
  simulate("city", 4);
  ASSERT_EQ(map_city().exit_code, 0);
  ASSERT_TRUE(exists("out/trajectory.png"));
  ASSERT_TRUE(exists("out/poses_odometry.txt"));
  write("out/notes.txt", "mine");
  std::filesystem::remove(folder_ / "city/poses.txt");
  ASSERT_EQ(map_city("--force --loops off --mount 0,0,1,0,0,0").exit_code, 0);
  for (const char* old : {"trajectory.png", "poses_odometry.txt", "poses_lidar.txt"})
    EXPECT_FALSE(exists(std::string("out/") + old)) << old;
  EXPECT_TRUE(exists("out/poses_base.txt"));
  EXPECT_EQ(content("out/notes.txt"), "mine");
}

TEST_F(MapCommandTest, AConfigurationWithoutASensorLeavesItToTheRecording) {
  simulate("city", 3);
  write("server.yaml", "log: {level: info}\n");
  ASSERT_EQ(map_city("--config " + path("server.yaml")).exit_code, 0);
  ASSERT_EQ(run("map " + path("city") + " --out " + path("plain")).exit_code, 0);
  EXPECT_EQ(content("out/poses_lidar.txt"), content("plain/poses_lidar.txt"));
}

TEST_F(MapCommandTest, ReadersOfAMapLeaveItAlone) {
  simulate("city", 4);
  ASSERT_EQ(map_city().exit_code, 0);
  std::filesystem::create_directory(folder_ / "kept");
  std::filesystem::copy_file(folder_ / "out/map.stillmap", folder_ / "kept/map.stillmap");
  // What a server that was killed leaves.
  write("kept/map.stillmap-wal", "");
  const std::string before = content("kept/map.stillmap");
  const std::string map = path("kept/map.stillmap");
  EXPECT_EQ(run("localize " + map + " " + path("city") + " --scans 1").exit_code, 0);
  EXPECT_NE(run("plan --map " + map + " --from 0,0 --to 3,0").exit_code, 2);
  EXPECT_NE(run("traversable " + map).exit_code, 2);
  EXPECT_NE(run("octomap --map " + map + " --point 0,0,0").exit_code, 2);
  EXPECT_EQ(run("evaluate map --map " + map + " --truth " + path("city")).exit_code, 0);
  EXPECT_EQ(content("kept/map.stillmap"), before);
  EXPECT_TRUE(exists("kept/map.stillmap-wal"));
  EXPECT_FALSE(exists("kept/map.stillmap-shm"));
}

TEST_F(MapCommandTest, ListsClosedAndRefusedLoops) {
  simulate("city", 3);
  ASSERT_EQ(map_city("--deny-loop 0:2").exit_code, 0);
  const std::string loops = "loops " + path("out");
  EXPECT_EQ(run(loops).out, "0 closed, 0 refused\n");
  EXPECT_EQ(run("loops " + path("city")).exit_code, 2) << "there is no report";

  std::filesystem::create_directory(folder_ / "made");
  const std::string made = "loops " + path("made");
  write("made/report.json",
        R"({"closures": [{"from_scan": 12, "to_scan": 340, "jump_m": 0.26, "overlap": 0.81,
            "score": 0.93, "runner_up": 0.4, "refusal": null}],
            "loops": {"refused": [{"from_scan": 20, "to_scan": 350, "jump_m": 4,
            "refusal": "denied by who maps"}]}})");
  EXPECT_THAT(run(made).out, AllOf(HasSubstr("12:340"), HasSubstr("0.26"), HasSubstr("closed"),
                                   HasSubstr("1 closed, 1 refused"), Not(HasSubstr("20:350"))));
  EXPECT_THAT(run(made + " --refused").out,
              AllOf(HasSubstr("20:350"), HasSubstr("refused: denied by who maps")));
  const nlohmann::json json = nlohmann::json::parse(run(made + " --json").out);
  EXPECT_EQ(json.at("closures").at(0).at("to_scan"), 340);
  for (const char* damaged :
       {"", "{", "[]", R"({"closures": null, "loops": null})", R"({"closures": [], "loops": 3})",
        R"({"closures": 3, "loops": {}})"}) {
    write("made/report.json", damaged);
    EXPECT_EQ(run(made).exit_code, 2) << damaged;
  }
  // What somebody wrote by hand is no reason to fall over.
  write("made/report.json", R"({"closures": [7, {"jump_m": "far"}], "loops": {"refused": 3}})");
  EXPECT_EQ(run(made + " --refused").exit_code, 0);
}

TEST_F(MapCommandTest, AReceiverSaysWhereTheMapLies) {
  ASSERT_EQ(run("simulate " + path("city") +
                " --preset quiet --seed 3 --sensor vlp_16 --scans 120 --gnss 0.02")
                .exit_code,
            0);
  const ProcessResult result = map_city("--json --labels files --antenna 0,0,0");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json report = nlohmann::json::parse(result.out);
  const nlohmann::json& gnss = report.at("loops").at("gnss");
  EXPECT_EQ(gnss.at("fixes"), 61);
  EXPECT_GE(gnss.at("in_graph"), 8);
  ASSERT_TRUE(gnss.at("datum").is_string()) << gnss;
  EXPECT_THAT(gnss.at("datum").get<std::string>(), testing::StartsWith("49.0"));
  EXPECT_LT(report.at("accuracy").at("ate_rmse_m"), 0.5);
  // The file has it, so that a GeoTIFF needs no --datum.
  EXPECT_EQ(run("map-export " + path("out/map.stillmap") + " -o " + path("map.tif")).exit_code, 0);
  EXPECT_TRUE(exists("map.tif"));

  const ProcessResult without = map_city("--json --labels files --gnss off --force");
  EXPECT_TRUE(nlohmann::json::parse(without.out).at("loops").at("gnss").is_null());
  EXPECT_EQ(map_city("--antenna 0,0,0 --gnss off --force").exit_code, 2);
  EXPECT_EQ(map_city("--antenna 0,0,nan --force").exit_code, 2);
  write("city/gnss.csv", "1,49,8\n");
  const ProcessResult damaged = map_city("--labels files --force");
  EXPECT_NE(damaged.exit_code, 0);
  EXPECT_THAT(damaged.err, HasSubstr("gnss.csv"));
  EXPECT_TRUE(exists("out/map.stillmap"));
}

TEST_F(MapCommandTest, WhatIsRefusedLeavesTheOldMap) {
  simulate("city", 3);
  ASSERT_EQ(map_city().exit_code, 0);
  const std::string before = content("out/map.stillmap");
  for (const char* wrong :
       {"--labels nosuchmodel", "--start 9", "--sensor vlp_17", "--config no.yaml", "--resume",
        "--deny-loop 12", "--deny-loop 12:", "--deny-loop 12:x", "--deny-loop 12:12",
        "--deny-loop 12:40x", "--deny-loop 1:2 --loops off", "--deny-loop 0:2 --start 1",
        "--deny-loop 0:2 --scans 2"}) {
    EXPECT_EQ(map_city(std::string(wrong) + " --force").exit_code, 2) << wrong;
    EXPECT_EQ(content("out/map.stillmap"), before) << wrong;
  }
  truncate("city/labels/000001.label", 10);
  EXPECT_EQ(map_city("--force --strict").exit_code, 2);
  EXPECT_EQ(content("out/map.stillmap"), before);
}

TEST_F(MapCommandTest, ASignalLeavesTheOldMapAndTheRunCanBeResumed) {
  simulate("city", 3);
  ASSERT_EQ(map_city().exit_code, 0);
  const std::string before = content("out/map.stillmap");
  simulate("street", 120);
  const std::string map = "map " + path("street") + " --out " + path("out") + " --labels none";
  const char* how = " --force --save-period 0.01";
  for (const int signal : {SIGKILL, SIGINT, SIGHUP}) {
    BackgroundProcess running(stillmap_program() + " " + map + how, folder_ / "log");
    ASSERT_TRUE(has_enough_to_resume()) << content("log");
    running.send(signal);
    ASSERT_EQ(running.wait(), signal == SIGKILL ? -1 : 1) << content("log");
    EXPECT_EQ(content("out/map.stillmap"), before) << signal;
    how = " --resume --save-period 0.01";
  }
  EXPECT_EQ(run(map).exit_code, 2) << "an unfinished run is not thrown away unasked";
  const ProcessResult other = run(map + " --resume --weighting geometric");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, AllOf(HasSubstr("weighting semantic"), HasSubstr("weighting geometric"),
                               HasSubstr("--force")));
  const ProcessResult resumed = run(map + " --resume --json");
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  const nlohmann::json report = nlohmann::json::parse(resumed.out);
  EXPECT_GT(report.at("resumed_at_scan"), 0);
  EXPECT_EQ(report.at("scans"), 120);
  EXPECT_LT(report.at("accuracy").at("ate_rmse_m"), 0.5);
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 120U);
  EXPECT_FALSE(exists("out/unfinished"));
}

TEST_F(MapCommandTest, FilesThatAreNotOfARunAreLeftAlone) {
  simulate("city", 2);
  std::filesystem::create_directories(folder_ / "out/unfinished");
  std::ofstream(folder_ / "out/unfinished/thesis.tex") << "chapter 1";
  for (const char* const how : {"", "--force"}) {
    const ProcessResult refused = map_city(how);
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.err, HasSubstr("other files"));
    EXPECT_EQ(content("out/unfinished/thesis.tex"), "chapter 1");
  }
}

// A damaged state is no reason to throw it away.
TEST_F(MapCommandTest, ARunWhoseStateCannotBeReadIsLeftAlone) {
  simulate("city", 2);
  std::filesystem::create_directories(folder_ / "out/unfinished");
  std::ofstream(folder_ / "out/unfinished/run.stillmap") << std::string(5000, 'x');
  for (const char* const how : {"", "--resume"}) {
    EXPECT_EQ(map_city(how).exit_code, 2) << how;
    EXPECT_TRUE(exists("out/unfinished/run.stillmap")) << how;
  }
  EXPECT_EQ(map_city("--force").exit_code, 0);
}

TEST_F(MapCommandTest, EveryMapHasAnIdOfItsOwn) {
  simulate("city", 2);
  std::set<std::uint64_t> ids;
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(map_city("--force").exit_code, 0);
    const ProcessResult info = run("map-info --json " + path("out/map.stillmap"));
    ids.insert(nlohmann::json::parse(info.out).at("map_id").get<std::uint64_t>());
  }
  EXPECT_EQ(ids.size(), 2U);
  EXPECT_FALSE(ids.contains(0));
}

TEST_F(MapCommandTest, OutputThatCannotBeWrittenIsAFailure) {
  simulate("city", 2);
  ASSERT_EQ(map_city().exit_code, 0);
  const std::string out_map = path("out/map.stillmap");
  for (const std::string& arguments :
       {std::string("--help"), std::string("--version"), "map-info " + out_map,
        "map-info --json " + out_map, "map-check " + out_map, std::string("model --help"),
        "map " + path("city") + " --force --out " + path("out")}) {
    const std::string command =
        stillmap_program() + " " + arguments + " > /dev/full 2> " + path("err");
    const int status = std::system(command.c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1) << arguments;
    EXPECT_THAT(content("err"), HasSubstr("stdout")) << arguments;
  }
  const std::string server = stillmap_server_program() + " --version > /dev/full 2> /dev/null";
  EXPECT_EQ(WEXITSTATUS(std::system(server.c_str())), 1);
}

TEST_F(MapCommandTest, NamesADamagedFileAndGoesOn) {
  simulate("city", 4);
  truncate("city/velodyne/000001.bin", 1001);
  const ProcessResult result = map_city();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("000001.bin"));
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 3U);
  const nlohmann::json report = nlohmann::json::parse(content("out/report.json"));
  EXPECT_EQ(report.at("skipped").at(0).at("scan"), 1);
  EXPECT_EQ(report.at("skipped").at(0).at("counter"), "unreadable");
}

TEST_F(MapCommandTest, LeavesLoopsOpenWhereStampsWereSetBack) {
  simulate("city", 24);
  std::ofstream times(folder_ / "city/times.txt", std::ios::trunc);
  for (int k = 0; k < 24; ++k) times << (k < 8 ? 100.0 : 0.0) + 0.1 * k << "\n";
  times.close();
  const ProcessResult result = map_city();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("loops are left open"));
  const nlohmann::json report = nlohmann::json::parse(content("out/report.json"));
  EXPECT_TRUE(report.at("loops").is_null());
  EXPECT_TRUE(exists("out/map.stillmap"));
}

TEST_F(MapCommandTest, StopsAtADamagedFileWhenStrict) {
  simulate("city", 3);
  truncate("city/labels/000001.label", 10);
  const ProcessResult result = map_city("--strict");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("000001.label"));
  EXPECT_FALSE(exists("out/map.stillmap"));
}

TEST_F(MapCommandTest, LeavesOutAnEmptyScanAndSaysSo) {
  simulate("city", 3);
  truncate("city/velodyne/000002.bin", 0);
  truncate("city/labels/000002.label", 0);
  const ProcessResult result = map_city();
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("000002.bin"));
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 2U);
}

TEST_F(MapCommandTest, RefusesInputItCannotUse) {
  simulate("city", 2);
  const auto refusal = [&](const std::string& arguments) {
    const ProcessResult result = run("map " + arguments + " --out " + path("out"));
    EXPECT_EQ(result.exit_code, 2) << arguments;
    return result.err;
  };
  EXPECT_THAT(refusal(path("nowhere")), HasSubstr(path("nowhere")));
  std::filesystem::create_directories(folder_ / "empty");
  EXPECT_THAT(refusal(path("empty")), HasSubstr(path("empty")));
  EXPECT_THAT(refusal(path("city") + " --sensor vlp_17"), HasSubstr("vlp_17"));
  EXPECT_THAT(refusal(path("city") + " --labels " + path("no_model")), HasSubstr("no_model"));
  EXPECT_THAT(refusal(path("city") + " --weighting heavy"), HasSubstr("heavy"));
  EXPECT_THAT(refusal(path("city") + " --start 9"), HasSubstr("has 2"));
  EXPECT_THAT(refusal(path("city") + " --config " + path("no.yaml")), HasSubstr("no.yaml"));
}

TEST_F(MapCommandTest, RefusesFileLabelsWhereThereAreNone) {
  simulate("city", 2);
  std::filesystem::remove_all(folder_ / "city/labels");
  const ProcessResult result = map_city("--labels files");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("has no labels"));
  EXPECT_EQ(map_city().exit_code, 0);
}

TEST_F(MapCommandTest, FilesThatHaveTheNameOfAResultAreReplacedOnlyWhenForced) {
  simulate("city", 3);
  std::filesystem::create_directory(folder_ / "out");
  const std::vector<std::string> names{"report.json", "map.ply", "poses_base.txt",
                                       "loops_after.png"};
  for (const std::string& name : names) {
    write("out/" + name, "mine");
    const ProcessResult refused = map_city();
    EXPECT_EQ(refused.exit_code, 2) << name;
    EXPECT_THAT(refused.err, AllOf(HasSubstr(path("out/" + name)), HasSubstr("--force"))) << name;
    EXPECT_EQ(content("out/" + name), "mine");
    std::filesystem::remove(folder_ / "out" / name);
  }
  for (const std::string& name : names) write("out/" + name, "mine");
  ASSERT_EQ(map_city("--force").exit_code, 0);
  EXPECT_TRUE(nlohmann::json::accept(content("out/report.json")));
  // There was no map that they could have been of.
  for (const char* name : {"poses_base.txt", "loops_after.png"})
    EXPECT_EQ(content(std::string("out/") + name), "mine") << name;
}

TEST_F(MapCommandTest, AFileInThePlaceOfTheUnfinishedRunIsLeftAlone) {
  simulate("city", 2);
  std::filesystem::create_directory(folder_ / "out");
  write("out/unfinished", "chapter 1");
  for (const char* const how : {"", "--force"}) {
    const ProcessResult refused = map_city(how);
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.err, HasSubstr(path("out/unfinished")));
    EXPECT_EQ(content("out/unfinished"), "chapter 1");
  }
}

TEST_F(MapCommandTest, ARunIsResumedAsItBegan) {
  simulate("city", 14);
  truncate("city/labels/000012.label", 10);
  ASSERT_EQ(map_city("--strict --save-period 0.0001").exit_code, 2);
  ASSERT_TRUE(exists("out/unfinished/run.stillmap"));
  const ProcessResult fewer = map_city("--resume --scans 5");
  EXPECT_EQ(fewer.exit_code, 2);
  EXPECT_THAT(fewer.err, AllOf(HasSubstr("seen 12 scans"), HasSubstr("the 5 that"),
                               HasSubstr("--scans"), HasSubstr("--force")));
  write("server.yaml", "log: {level: info}\n");
  const ProcessResult other = map_city("--resume --config " + path("server.yaml"));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("configuration of digest"));
  ASSERT_TRUE(exists("out/unfinished/run.stillmap"));
  const ProcessResult all = map_city("--resume --scans 12");
  EXPECT_EQ(all.exit_code, 0) << all.err;
  EXPECT_EQ(line_count("out/poses_lidar.txt"), 12U);
}

TEST_F(MapCommandTest, AFullDiskIsNoFaultOfWhatWasAskedFor) {
  simulate("city", 6);
  BackgroundProcess full("sh -c 'ulimit -f 64; exec " + stillmap_program() + " map " +
                             path("city") + " --labels none --out " + path("out") + "'",
                         folder_ / "log");
  EXPECT_EQ(full.wait(), 1);
  EXPECT_THAT(content("log"), HasSubstr("cannot be written"));
}

TEST_F(MapCommandTest, ADeniedLoopIsOfScansThatThereAre) {
  simulate("city", 3);
  const ProcessResult refused = map_city("--deny-loop 1:5000");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("--deny-loop 1:5000"), HasSubstr("0 to 2")));
  EXPECT_FALSE(exists("out"));
}

}  // namespace
}  // namespace stillmap::test
