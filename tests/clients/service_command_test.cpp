#include <cstdlib>
#include <stdexcept>
#include <vector>

#include "clients/commands/query/query_report.hpp"
#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

class ServiceCommandTest : public CommandTest {
 protected:
  [[nodiscard]] std::string on_domain() const { return " --domain " + std::to_string(domain_); }

  [[nodiscard]] std::string server_command(const std::string& more = "") const {
    return stillmap_server_program() + " --map-file " + path("server.stillmap") + on_domain() +
           " " + more;
  }

  int domain_ = free_domain();
};

TEST_F(ServiceCommandTest, WithoutAServerIsExitCodeThree) {
  simulate("city", 1);
  for (const std::string& command :
       {std::string("status"), std::string("query"), std::string("save"), std::string("reset"),
        std::string("watch"), std::string("traversable"), std::string("nearest --to 0 0"),
        std::string("check-path --path 0 0 1 0"), std::string("loops"), "replay " + path("city")}) {
    const ProcessResult result = run(command + on_domain() + " --timeout 0.5");
    EXPECT_EQ(result.exit_code, 3) << command;
    EXPECT_THAT(result.err, HasSubstr(std::to_string(domain_))) << command;
  }
}

TEST_F(ServiceCommandTest, RefusesWrongRegionsClassesAndFilesBeforeAsking) {
  const std::string query = "query" + on_domain() + " --timeout 0.5 ";
  EXPECT_EQ(run(query + "--box 1 2 3").exit_code, 2);
  EXPECT_EQ(run(query + "--box 0 0 0 1 1 1 --around 0 0 5").exit_code, 2);
  EXPECT_EQ(run(query + "--around-robot -5").exit_code, 2);
  EXPECT_EQ(run(query + "--out map.las").exit_code, 2);
  for (const auto& [region, named] :
       {std::pair("--polygon 0 0 9 9 9 0 0 9", "polygon edges 0"),
        std::pair("--polygon 0 0 9", "give an x and a y"),
        std::pair("--corridor no_such_file --width 3", "no_such_file"),
        std::pair("--corridor 0 0 9 9", "--width"),
        std::pair("--sphere 0 0 0 -4", "sphere radius_m is -4"),
        std::pair("--box -1e9 -1e9 -1e9 1e9 1e9 1e9", "within 1000000 m")}) {
    const ProcessResult refused = run(query + region);
    EXPECT_EQ(refused.exit_code, 2) << region;
    EXPECT_THAT(refused.err, HasSubstr(named));
  }
  const ProcessResult result = run(query + "--classes road,house");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("house"), HasSubstr("building")));
  EXPECT_EQ(run("status --domain 500").exit_code, 2);
}

TEST_F(ServiceCommandTest, ReplayOverDdsGivesThePosesThatMapGives) {
  simulate("city", 8);
  BackgroundProcess server(server_command("--delivery every"), folder_ / "server.log");
  const ProcessResult replay = run("replay " + path("city") + " --lossless --json" + patiently() +
                                   on_domain() + " --out " + path("replayed.txt"));
  ASSERT_EQ(replay.exit_code, 0) << replay.err << content("server.log");
  const nlohmann::json json = nlohmann::json::parse(replay.out);
  EXPECT_EQ(json.at("published"), 8);
  EXPECT_EQ(json.at("mapped"), 8);
  EXPECT_EQ(json.at("dropped"), 0);
  ASSERT_EQ(run("map " + path("city") + " --out " + path("out")).exit_code, 0);
  const ProcessResult same =
      run("evaluate trajectory --json --truth " + path("out/poses_lidar.txt") + " --estimate " +
          path("replayed.txt"));
  ASSERT_EQ(same.exit_code, 0) << same.err;
  EXPECT_LT(nlohmann::json::parse(same.out).at("ate_unaligned_rmse_m"), 1e-6);
  EXPECT_EQ(server.stop(), 0) << content("server.log");
  EXPECT_TRUE(exists("server.stillmap"));
}

TEST_F(ServiceCommandTest, ReplayWorksOverTcp) {
  simulate("city", 4);
  std::ofstream(path("wan.yaml")) << "transport: tcp\nserver_port: " << 31000 + domain_ << "\n";
  const std::string over_tcp = " --dds-profile " + path("wan.yaml");
  BackgroundProcess server(server_command("--delivery every") + over_tcp, folder_ / "server.log");
  const ProcessResult replay = run("replay " + path("city") + " --lossless --json" + patiently() +
                                   over_tcp + " --peer 127.0.0.1" + on_domain());
  ASSERT_EQ(replay.exit_code, 0) << replay.err << content("server.log");
  EXPECT_EQ(nlohmann::json::parse(replay.out).at("mapped"), 4);
}

TEST_F(ServiceCommandTest, WatchFollowsThePosesOfAReplay) {
  simulate("city", 8);
  BackgroundProcess server(server_command("--delivery every"), folder_ / "server.log");
  ASSERT_EQ(run("status" + patiently() + on_domain()).exit_code, 0) << content("server.log");
  BackgroundProcess watch(stillmap_program() + " watch --json --count 4" + patiently("--duration") +
                              " --out " + path("watched.tum") + on_domain(),
                          folder_ / "watch.log");
  ASSERT_TRUE(comes_to_contain("watch.log", "\"status\""));
  ASSERT_EQ(run("replay " + path("city") + " --rate 4" + on_domain()).exit_code, 0);
  EXPECT_EQ(watch.wait(), 0) << content("watch.log");
  EXPECT_EQ(line_count("watched.tum"), 1U + 4U);
  EXPECT_THAT(content("watch.log"), HasSubstr("\"quaternion_xyzw\""));
}

TEST_F(ServiceCommandTest, LosslessReplayRefusesAServerThatDropsScans) {
  simulate("city", 2);
  BackgroundProcess server(server_command("--delivery latest"), folder_ / "server.log");
  const ProcessResult replay =
      run("replay " + path("city") + " --lossless" + patiently() + on_domain());
  EXPECT_EQ(replay.exit_code, 2);
  EXPECT_THAT(replay.err, HasSubstr("--delivery every"));
}

TEST_F(ServiceCommandTest, ReplayOfScansThatTheServerHasGivesNoPosesOfThen) {
  simulate("city", 6);
  BackgroundProcess server(server_command("--delivery every"), folder_ / "server.log");
  ASSERT_EQ(run("replay " + path("city") + " --lossless" + patiently() + on_domain()).exit_code, 0)
      << content("server.log");
  const ProcessResult again =
      run("replay " + path("city") + " --scans 3 --rate 20 --json" + patiently() + on_domain());
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, AllOf(HasSubstr("mapped none of the 3"), HasSubstr("stillmap reset")));
  EXPECT_EQ(nlohmann::json::parse(again.out).at("poses"), 0);
}

TEST_F(ServiceCommandTest, ARobotWithoutAPoseIsNoMissingServer) {
  BackgroundProcess server(server_command(), folder_ / "server.log");
  ASSERT_EQ(run("status" + patiently() + on_domain()).exit_code, 0) << content("server.log");
  for (const char* command :
       {"query --around-robot 30", "traversable --around-robot 30", "plan --to 5,0"}) {
    const ProcessResult result = run(command + std::string(" --timeout 5") + on_domain());
    EXPECT_EQ(result.exit_code, 1) << command;
    EXPECT_THAT(result.err, HasSubstr("no pose yet")) << command;
    EXPECT_THAT(result.err, HasSubstr("no scan received")) << command;
  }
}

TEST_F(ServiceCommandTest, AsksARunningServerForEverythingOfItsMap) {
  simulate("city", 5);
  BackgroundProcess server(server_command("--delivery every"), folder_ / "server.log");
  ASSERT_EQ(run("replay " + path("city") + " --lossless" + patiently() + on_domain()).exit_code, 0)
      << content("server.log");

  const nlohmann::json status = nlohmann::json::parse(run("status --json" + on_domain()).out);
  EXPECT_EQ(status.at("counters").at("scans_mapped"), 5);
  EXPECT_GT(status.at("voxels"), 100);

  const ProcessResult query = run("query --around-robot 30 --json" + on_domain() + " --out " +
                                  path("near.ply") + " --picture " + path("near.png"));
  ASSERT_EQ(query.exit_code, 0) << query.err;
  EXPECT_GT(nlohmann::json::parse(query.out).at("voxels"), 100);
  EXPECT_TRUE(exists("near.ply"));
  EXPECT_TRUE(exists("near.png"));

  const ProcessResult roads = run("query --classes road --json" + on_domain());
  EXPECT_EQ(nlohmann::json::parse(roads.out).at("classes").size(), 1U);
  EXPECT_EQ(run("query --box 5 0 0 -5 1 1" + on_domain()).exit_code, 2);

  write("way.txt", "# metres\n-30 0\n30, 0.5\n");
  const nlohmann::json way = nlohmann::json::parse(
      run("query --corridor " + path("way.txt") + " --width 6 --max-z 3 --json" + on_domain()).out);
  EXPECT_GT(way.at("voxels"), 10);
  EXPECT_EQ(way.at("box_map").at("max").at(2), 3.0);
  EXPECT_GT(way.at("tiles").size(), 0U);
  const std::string version = way.at("map_version").dump();
  const nlohmann::json unchanged =
      nlohmann::json::parse(run("query --json --since-version " + version + on_domain()).out);
  EXPECT_EQ(unchanged.at("voxels"), 0);
  const ProcessResult unknown = run("query --since-map 1 --since-version 1" + on_domain());
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("ask for everything"));
  const ProcessResult outside = run("save ../up.stillmap" + on_domain());
  EXPECT_EQ(outside.exit_code, 2) << outside.err;
  EXPECT_THAT(outside.err, HasSubstr("was refused: file '../up.stillmap'"));
  // The largest number is no word for none.
  const ProcessResult future = run("query --since-version 18446744073709551615" + on_domain());
  EXPECT_EQ(future.exit_code, 2);
  EXPECT_THAT(future.err, HasSubstr("since_version is 18446744073709551615, the map is at"));

  const std::string tiles = std::to_string(way.at("tiles").size());
  const ProcessResult watched =
      run("watch-tiles --json" + patiently("--duration") + " --count " + tiles + " --corridor " +
          path("way.txt") + " --width 6" + on_domain());
  EXPECT_EQ(watched.exit_code, 0) << watched.err;
  EXPECT_THAT(watched.out, HasSubstr("\"change\":\"appeared\""));

  const nlohmann::json submaps = nlohmann::json::parse(run("loops --json" + on_domain()).out);
  EXPECT_EQ(submaps.at("map_id"), status.at("map_id"));
  EXPECT_EQ(submaps.at("submaps"), nlohmann::json::array()) << "five scans are no submap";
  EXPECT_THAT(run("loops" + on_domain()).out, HasSubstr("0 submaps, 0 loops closed"));
  EXPECT_EQ(run("loops --refused" + on_domain()).exit_code, 2);
}

TEST_F(ServiceCommandTest, HasARunningServerSaveLoadAndReset) {
  simulate("city", 5);
  BackgroundProcess server(server_command("--delivery every"), folder_ / "server.log");
  ASSERT_EQ(run("replay " + path("city") + " --lossless" + patiently() + on_domain()).exit_code, 0)
      << content("server.log");
  const nlohmann::json status = nlohmann::json::parse(run("status --json" + on_domain()).out);

  EXPECT_EQ(run("save saved.stillmap" + on_domain()).exit_code, 0);
  EXPECT_TRUE(exists("saved.stillmap"));
  const nlohmann::json loaded =
      nlohmann::json::parse(run("load saved.stillmap --json" + on_domain()).out);
  EXPECT_EQ(loaded.at("poses"), 5);
  EXPECT_EQ(loaded.at("tiles"), status.at("tiles"));
  const nlohmann::json again = nlohmann::json::parse(run("load --json" + on_domain()).out);
  EXPECT_EQ(again.at("poses"), 5);
  EXPECT_THAT(std::string(again.at("file")), HasSubstr("saved.stillmap"));
  const ProcessResult not_there = run("load nothing.stillmap" + on_domain());
  EXPECT_EQ(not_there.exit_code, 1);
  EXPECT_THAT(not_there.err, HasSubstr("is not there"));
  EXPECT_EQ(run("reset" + on_domain()).exit_code, 0);
  const nlohmann::json empty = nlohmann::json::parse(run("status --json" + on_domain()).out);
  EXPECT_EQ(empty.at("voxels"), 0);
  EXPECT_NE(empty.at("map_id"), status.at("map_id"));
  const nlohmann::json none = nlohmann::json::parse(run("loops --json" + on_domain()).out);
  EXPECT_EQ(none.at("map_id"), empty.at("map_id"));
}

TEST_F(ServiceCommandTest, ServerAndClientsMeetInTheDomainOfRos) {
  ASSERT_EQ(setenv("ROS_DOMAIN_ID", std::to_string(domain_).c_str(), 1), 0);
  BackgroundProcess server(stillmap_server_program() + " --map-file " + path("server.stillmap"),
                           folder_ / "server.log");
  EXPECT_EQ(run("status" + patiently()).exit_code, 0) << content("server.log");
  EXPECT_EQ(unsetenv("ROS_DOMAIN_ID"), 0);
}

TEST_F(ServiceCommandTest, AServerThatClosesNoLoopsHasNoSubmaps) {
  write("open.yaml", "map: {close_loops: false}\n");
  BackgroundProcess server(server_command("--config " + path("open.yaml")), folder_ / "server.log");
  ASSERT_EQ(run("status" + patiently() + on_domain()).exit_code, 0) << content("server.log");
  const ProcessResult none = run("loops --timeout 2" + on_domain());
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.err, HasSubstr("map.close_loops"));
}

TEST_F(ServiceCommandTest, AsksARunningServerWhereARobotCanGo) {
  simulate("city", 5);
  BackgroundProcess server(server_command("--delivery every"), folder_ / "server.log");
  ASSERT_EQ(run("replay " + path("city") + " --lossless" + patiently() + on_domain()).exit_code, 0)
      << content("server.log");
  // The area follows the map within a moment.
  ProcessResult nearest;
  for (int i = 0; i < 60 && nearest.exit_code != 0; ++i) {
    nearest = run("nearest --to 3 0 --json" + on_domain());
  }
  ASSERT_EQ(nearest.exit_code, 0) << nearest.err;
  EXPECT_GE(nlohmann::json::parse(nearest.out).at("distance_m"), 0.0);
  const ProcessResult area =
      run("traversable --around-robot 30 --json" + on_domain() + " --out " + path("nav2") +
          " --picture " + path("area.png") + " --outlines " + path("area.json"));
  ASSERT_EQ(area.exit_code, 0) << area.err;
  EXPECT_GT(nlohmann::json::parse(area.out).at("free_m2"), 10.0);
  for (const std::string file : {"nav2/map.yaml", "area.png", "area.json"}) {
    EXPECT_TRUE(exists(file)) << file;
  }
  const ProcessResult blocked = run("check-path --path 3 0 300 0" + on_domain());
  EXPECT_EQ(blocked.exit_code, 1) << blocked.err;
  EXPECT_THAT(blocked.out, HasSubstr("blocked for car"));
  const ProcessResult nobody = run("traversable --profile submarine" + on_domain());
  EXPECT_EQ(nobody.exit_code, 2);
  EXPECT_THAT(nobody.err, AllOf(HasSubstr("submarine"), HasSubstr("car, delivery_robot")));
}

TEST_F(ServiceCommandTest, RestoresNothingWithoutABox) {
  const std::string removed = "removed" + on_domain() + " --timeout 0.5 --restore ";
  for (const auto& [rest, named] :
       {std::pair("moving", "--around-robot"), std::pair("moving --min-z 0", "--around-robot"),
        std::pair("moving --sphere 0 0 0 5", "--around-robot"),
        std::pair("still --box 0 0 0 1 1 1", "no reason"),
        std::pair("moving --box 0 0 0 1 1 1 --picture x.png", "--picture x.png")}) {
    const ProcessResult refused = run(removed + rest);
    EXPECT_EQ(refused.exit_code, 2) << rest;
    EXPECT_THAT(refused.err, HasSubstr(named)) << rest;
  }
  EXPECT_EQ(run(removed + "moving --around 0 0 5").exit_code, 3) << "nobody is asked before";
}

TEST_F(ServiceCommandTest, WatchTriesItsFileFirst) {
  const std::string watch = "watch" + on_domain() + " --timeout 0.5 --out ";
  const ProcessResult refused = run(watch + path("no/poses.tum"));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr(path("no/poses.tum")));
  write("old.tum", "mine");
  EXPECT_EQ(run(watch + path("old.tum")).exit_code, 3);
  EXPECT_EQ(content("old.tum"), "mine");
  EXPECT_EQ(run(watch + path("new.tum")).exit_code, 3);
  EXPECT_FALSE(exists("new.tum"));
}

TEST_F(ServiceCommandTest, WhatAMapHasNotYetIsNoWrongInput) {
  BackgroundProcess server(server_command(""), folder_ / "server.log");
  ASSERT_EQ(run("status" + patiently() + on_domain()).exit_code, 0) << content("server.log");
  for (const std::string asked : {"traversable", "nearest --to 3 0", "check-path --path 0 0 3 0"}) {
    const ProcessResult early = run(asked + on_domain());
    EXPECT_EQ(early.exit_code, 1) << asked << early.err;
    EXPECT_THAT(early.out + early.err, HasSubstr("empty")) << asked;
  }
}

TEST(QueryAnswer, WhatOnlyCannotBeAnsweredNowIsNoWrongInput) {
  MapQueryResult result;
  EXPECT_NO_THROW(cli::require_answer(result));
  for (const QueryStatus status : {QueryStatus::stale_continuation, QueryStatus::failed}) {
    result.status = status;
    EXPECT_THROW(cli::require_answer(result), std::runtime_error);
  }
  for (const QueryStatus status : {QueryStatus::invalid_request, QueryStatus::changes_unknown}) {
    result.status = status;
    EXPECT_THROW(cli::require_answer(result), std::invalid_argument);
  }
}

}  // namespace
}  // namespace stillmap::test
