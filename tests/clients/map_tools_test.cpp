#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

/// Maps made by hand: commands that read files need no drive.
class MapToolsTest : public CommandTest {
 protected:
  /// A road of 40 m; with `fence`, one beside it; with `speck`, a voxel far above.
  void save_street(const std::string& file, bool fence, double voxel_size_m = 0.2,
                   bool speck = false) const {
    StaticMapConfig config;
    config.voxel_size_m = voxel_size_m;
    StaticMap map(config);
    LabelledScan scan;
    const auto add = [&](float x, float y, float z, SemanticClass label) {
      for (int i = 0; i < 3; ++i) {
        scan.scan.points_lidar.emplace_back(x, y, z);
        scan.labels.classes.push_back(label);
        scan.labels.confidence.push_back(1.0F);
        scan.motion.push_back(Motion::stationary);
      }
    };
    for (int i = 0; i < 200; ++i) {
      const float x = 0.2F * static_cast<float>(i) - 19.9F;
      add(x, 0.1F, 0.1F, SemanticClass::road);
      if (fence) add(x, 3.1F, 1.1F, SemanticClass::fence);
    }
    if (speck) add(0.1F, 0.1F, 9.1F, SemanticClass::vegetation);
    map.insert(scan, Eigen::Isometry3d::Identity());
    open_map_file(path(file))
        ->save({.view = *map.view(),
                .tile_evidence = {},
                .trajectory = {StampedPose{}, {.stamp_ns = 1'000'000'000}},
                .metadata = {{"sensor", "by hand"}}});
  }
  [[nodiscard]] nlohmann::json json_of(const std::string& command) const {
    const ProcessResult result = run(command + " --json");
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out);
  }
};

TEST_F(MapToolsTest, InfoSaysWhatAFileHolds) {
  save_street("street.stillmap", true);
  const nlohmann::json info = json_of("map-info " + path("street.stillmap"));
  EXPECT_EQ(info.at("voxels"), 400);
  EXPECT_EQ(info.at("classes").at("road"), 200);
  EXPECT_EQ(info.at("classes").at("fence"), 200);
  EXPECT_EQ(info.at("points"), 1200);
  EXPECT_EQ(info.at("poses"), 2);
  EXPECT_EQ(info.at("metadata").at("sensor"), "by hand");
  EXPECT_EQ(info.at("file").at("bytes"), std::filesystem::file_size(path("street.stillmap")));
  const ProcessResult text = run("map-info " + path("street.stillmap"));
  EXPECT_THAT(text.out, AllOf(HasSubstr("400 voxels"), HasSubstr("50.0 %  ####"),
                              HasSubstr("sensor: by hand")));
}

TEST_F(MapToolsTest, AClockThatWasSetBackIsSaidAndIsNoSession) {
  save_street("street.stillmap", true);
  EXPECT_EQ(run("sessions " + path("street.stillmap")).out.find("set back"), std::string::npos);
  SavedMap saved = open_map_file(path("street.stillmap"))->load();
  saved.trajectory = {StampedPose{.stamp_ns = 9'000'000'000}, {.stamp_ns = 1'000'000'000}};
  open_map_file(path("back.stillmap"))->save(saved);
  EXPECT_THAT(run("sessions " + path("back.stillmap")).out,
              HasSubstr("the clock of session 1 was set back"));
  EXPECT_THAT(run("map-check " + path("back.stillmap")).out, HasSubstr("2 poses of 1 session\n"));
  // Later than where it began by the end.
  saved.trajectory = {StampedPose{.stamp_ns = 1'000'000'000},
                      {.stamp_ns = 3'000'000'000},
                      {.stamp_ns = 2'000'000'000},
                      {.stamp_ns = 9'000'000'000},
                      {.stamp_ns = 8'000'000'000}};
  open_map_file(path("later.stillmap"))->save(saved);
  EXPECT_THAT(run("sessions " + path("later.stillmap")).out,
              HasSubstr("the clock of session 1 was set back while it was mapped, 2 times"));
  const nlohmann::json sessions =
      nlohmann::json::parse(run("sessions --json " + path("later.stillmap")).out);
  EXPECT_EQ(sessions.at(0).at("steps_back"), 2);
}

TEST_F(MapToolsTest, CheckTellsSoundFromDamagedByItsExitCode) {
  save_street("street.stillmap", true);
  const ProcessResult sound = run("map-check " + path("street.stillmap"));
  EXPECT_EQ(sound.exit_code, 0) << sound.out;
  EXPECT_THAT(sound.out, HasSubstr("valid: "));
  const std::string bytes = content("street.stillmap");
  write("cut.stillmap", bytes.substr(0, bytes.size() * 3 / 4));
  const ProcessResult damaged = run("map-check --json " + path("cut.stillmap"));
  EXPECT_EQ(damaged.exit_code, 1) << damaged.err;
  const nlohmann::json json = nlohmann::json::parse(damaged.out);
  EXPECT_FALSE(json.at("valid"));
  EXPECT_GT(json.at("faults").size(), 0U);
  EXPECT_EQ(content("cut.stillmap"), bytes.substr(0, bytes.size() * 3 / 4));
}

TEST_F(MapToolsTest, EveryToolRefusesWhatIsNoMapFileAndLeavesItAlone) {
  write("text", "this is no map file");
  save_street("street.stillmap", true);
  for (const std::string file : {"text", "missing"}) {
    for (const std::string& command : {"map-info " + path(file), "map-check " + path(file),
                                       "map-diff " + path("street.stillmap") + " " + path(file),
                                       "map-export " + path(file) + " --output " + path("x.ply")}) {
      const ProcessResult result = run(command);
      EXPECT_EQ(result.exit_code, 2) << command;
      EXPECT_THAT(result.err, HasSubstr(path(file))) << command;
      EXPECT_EQ(result.out, "") << command;
    }
  }
  EXPECT_EQ(content("text"), "this is no map file");
  EXPECT_FALSE(exists("missing"));
  EXPECT_FALSE(exists("x.ply"));
}

TEST_F(MapToolsTest, DiffNamesClassesAndTilesAndDrawsThem) {
  save_street("before.stillmap", true);
  save_street("after.stillmap", false);
  const std::string both = path("before.stillmap") + " " + path("after.stillmap");
  const nlohmann::json diff = json_of("map-diff " + both + " --picture " + path("diff.png"));
  EXPECT_EQ(diff.at("removed"), 200);
  EXPECT_EQ(diff.at("appeared"), 0);
  EXPECT_EQ(diff.at("classes").at("fence").at("removed"), 200);
  EXPECT_EQ(diff.at("classes").at("road").at("removed"), 0);
  EXPECT_GT(diff.at("tiles").size(), 1U);
  EXPECT_TRUE(exists("diff.png"));
  EXPECT_THAT(run("map-diff " + both).out, AllOf(HasSubstr("fence"), HasSubstr("200")));
  const std::string same = path("after.stillmap") + " " + path("after.stillmap");
  EXPECT_EQ(run("map-diff " + same).out, "nothing changed\n");

  save_street("coarse.stillmap", true, 0.4);
  const ProcessResult refused =
      run("map-diff " + path("before.stillmap") + " " + path("coarse.stillmap"));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("0.2"), HasSubstr("0.4")));
  EXPECT_EQ(run("map-diff --tolerance 9 " + both).exit_code, 2);
}

TEST_F(MapToolsTest, ExportTakesRegionsAndClasses) {
  save_street("street.stillmap", true);
  const std::string command = "map-export " + path("street.stillmap") + " --output ";
  EXPECT_EQ(json_of(command + path("all.pcd")).at("voxels"), 400);
  EXPECT_EQ(json_of(command + path("road.ply") + " --classes road").at("voxels"), 200);
  EXPECT_EQ(json_of(command + path("half.ply") + " --box 0 -9 -9 99 9 9").at("voxels"), 200);
  EXPECT_EQ(json_of(command + path("near.ply") + " --around-robot 4 --max-z 1").at("voxels"), 20);
  EXPECT_LT(json_of(command + path("few.ply") + " --resolution 1").at("voxels"), 100);
  for (const char* file : {"all.pcd", "road.ply", "half.ply", "near.ply", "few.ply"}) {
    EXPECT_TRUE(exists(file)) << file;
  }
}

TEST_F(MapToolsTest, ExportLeavesOutOutliers) {
  save_street("street.stillmap", true, 0.2, true);
  const std::string command = "map-export " + path("street.stillmap") + " --output ";
  EXPECT_EQ(json_of(command + path("all.ply")).at("voxels"), 401);
  const nlohmann::json json = json_of(command + path("clean.ply") + " --remove-outliers 3");
  EXPECT_EQ(json.at("voxels"), 400);
  EXPECT_EQ(json.at("outliers_removed"), 1);
  const ProcessResult text =
      run(command + path("clean.pcd") + " --remove-outliers 3 --outlier-neighbours 4");
  EXPECT_THAT(text.out, AllOf(HasSubstr("400 voxels written"), HasSubstr("outliers removed: 1")));
  for (const char* bad : {" --remove-outliers 0", " --remove-outliers -1", " --remove-outliers nan",
                          " --remove-outliers many", " --remove-outliers 3 --outlier-neighbours 0",
                          " --remove-outliers 3 --outlier-neighbours 2.5",
                          " --remove-outliers 3 --outlier-neighbours 500"}) {
    const ProcessResult result = run(command + path("bad.ply") + bad);
    EXPECT_EQ(result.exit_code, 2) << bad;
    EXPECT_THAT(result.err, testing::ContainsRegex("outlier|sigma")) << bad;
    EXPECT_FALSE(exists("bad.ply")) << bad;
  }
}

TEST_F(MapToolsTest, ExportWritesGeoTiffOnlyWithADatum) {
  save_street("street.stillmap", true);
  const std::string command = "map-export " + path("street.stillmap") + " --output ";
  const ProcessResult no_datum = run(command + path("street.tif"));
  EXPECT_EQ(no_datum.exit_code, 2);
  EXPECT_THAT(no_datum.err, AllOf(HasSubstr("--datum"), HasSubstr("48.137,11.575")));
  EXPECT_FALSE(exists("street.tif"));
  const nlohmann::json json = json_of(command + path("street.tif") + " --datum -33.9,151.2");
  EXPECT_EQ(json.at("files").size(), 2U);
  EXPECT_TRUE(exists("street.tif"));
  EXPECT_TRUE(exists("street_height.tif"));
  EXPECT_EQ(run(command + path("bad.tif") + " --datum 99,0").exit_code, 2);
}

TEST_F(MapToolsTest, ExportRefusesWhatItCannotWrite) {
  save_street("street.stillmap", true);
  const std::string command = "map-export " + path("street.stillmap") + " --output ";
  for (const auto& [rest, named] :
       {std::pair("x.las", ".pcd, .ply or .tif"), std::pair("x.bt", "octomap"),
        std::pair("x.ply --classes house", "house"),
        std::pair("x.ply --resolution 0.01", "resolution_m"),
        std::pair("x.ply --polygon 0 0 9 9 9 0 0 9", "polygon edges"),
        std::pair("no/x.ply", "no/x.ply"), std::pair("no/x.tif --datum 1,1", "no/x.tif"),
        std::pair("x.tif --datum 1,1 --box 900 900 0 901 901 1", "no voxels")}) {
    const ProcessResult result = run(command + (folder_ / rest).string());
    EXPECT_EQ(result.exit_code, 2) << rest;
    EXPECT_THAT(result.err, HasSubstr(named));
  }
}

TEST_F(MapToolsTest, LoadNeedsAServer) {
  const ProcessResult result =
      run("load x.stillmap --timeout 0.5 --domain " + std::to_string(free_domain()));
  EXPECT_EQ(result.exit_code, 3);
}

TEST_F(MapToolsTest, ALimitOfFileSizesIsAFullDisk) {
  save_street("street.stillmap", true);
  BackgroundProcess limited("env TMPDIR=" + folder_.string() + " sh -c 'ulimit -f 1; exec " +
                                stillmap_program() + " map-info " + path("street.stillmap") + "'",
                            folder_ / "log");
  EXPECT_EQ(limited.wait(), 1);
  EXPECT_THAT(content("log"), AllOf(HasSubstr("cannot be copied"), HasSubstr("make room")));
}

TEST_F(MapToolsTest, ADatumIsOfAGeoTiff) {
  save_street("street.stillmap", true);
  const std::string command = "map-export " + path("street.stillmap") + " --output ";
  const ProcessResult cloud = run(command + path("x.ply") + " --datum 49,8");
  EXPECT_EQ(cloud.exit_code, 2);
  EXPECT_THAT(cloud.err, AllOf(HasSubstr("--datum 49,8"), HasSubstr("x.ply"), HasSubstr(".tif")));
  EXPECT_FALSE(exists("x.ply"));
  const ProcessResult nowhere = run(command + path("x.ply") + " --datum here");
  EXPECT_EQ(nowhere.exit_code, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("here"));
}

TEST_F(MapToolsTest, RegionsMayBeInfiniteOnEitherSide) {
  save_street("street.stillmap", true);
  const std::string command = "map-export " + path("street.stillmap") + " --output ";
  EXPECT_EQ(json_of(command + path("all.ply") + " --box -inf -inf -inf inf inf inf").at("voxels"),
            400);
  const std::string half = command + path("half.ply");
  EXPECT_EQ(json_of(half + " --box 0 -Infinity -.9e1 inf INF inf").at("voxels"), 200);
  EXPECT_EQ(json_of(command + path("low.ply") + " --min-z -inf --max-z 1").at("voxels"), 200);
}

}  // namespace
}  // namespace stillmap::test
