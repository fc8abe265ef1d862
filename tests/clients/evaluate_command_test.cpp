#include <sstream>

#include "core/dataset/kitti_files.hpp"
#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

// Poses along one axis of the sensor, KITTI form.
std::string straight_path(int poses, double step_m, int axis = 0) {
  std::ostringstream text;
  for (int i = 0; i < poses; ++i) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) text << (row == column ? "1 " : "0 ");
      text << (row == axis ? step_m * i : 0.0) << (row == 2 ? "\n" : " ");
    }
  }
  return text.str();
}

class EvaluateCommandTest : public CommandTest {
 protected:
  [[nodiscard]] ProcessResult compare(const std::string& more = "") const {
    return run("evaluate trajectory --truth " + path("truth.txt") + " --estimate " +
               path("estimate.txt") + " " + more);
  }
};

TEST_F(EvaluateCommandTest, PrintsTheFiguresOfAKnownError) {
  write("truth.txt", straight_path(300, 1.0));
  write("estimate.txt", straight_path(300, 1.01));
  const ProcessResult result = compare("--json --pictures " + path("pictures"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json.at("poses"), 300);
  EXPECT_NEAR(json.at("final_drift_m"), 2.99, 1e-6);
  EXPECT_NEAR(json.at("relative").at("mean_translation_m"), 0.01, 1e-6);
  EXPECT_NEAR(json.at("kitti").at("translation_percent"), 1.0, 0.02);
  EXPECT_TRUE(exists("pictures/trajectory.png"));
  EXPECT_TRUE(exists("pictures/trajectory_error.png"));
  EXPECT_EQ(json.at("warning"), "");
}

TEST_F(EvaluateCommandTest, ShowsPeopleATableAndTheFrame) {
  write("truth.txt", straight_path(20, 1.0));
  write("estimate.txt", straight_path(20, 1.0));
  const ProcessResult result = compare();
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, AllOf(HasSubstr("Frame of both: lidar"), HasSubstr("best rigid fit"),
                                HasSubstr("shorter than 100 m")));
}

TEST_F(EvaluateCommandTest, WarnsWhenTheFramesSeemToDiffer) {
  write("truth.txt", straight_path(20, 1.0, 2));
  write("estimate.txt", straight_path(20, 1.0, 0));
  const ProcessResult result = compare("--json");
  EXPECT_THAT(result.err, HasSubstr("camera frame"));
  EXPECT_NE(nlohmann::json::parse(result.out).at("warning"), "");
}

TEST_F(EvaluateCommandTest, ConvertsACameraTruth) {
  simulate("city", 4);
  ASSERT_EQ(run("map " + path("city") + " --out " + path("out")).exit_code, 0);
  const ProcessResult result =
      run("evaluate trajectory --json --truth " + path("city/poses.txt") + " --truth-calib " +
          path("city/calib.txt") + " --estimate " + path("out/poses_lidar.txt"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json.at("frame"), "lidar");
  const nlohmann::json report = nlohmann::json::parse(content("out/report.json"));
  EXPECT_NEAR(json.at("ate_rmse_m").get<double>(),
              report.at("accuracy").at("ate_rmse_m").get<double>(), 1e-4);
}

TEST_F(EvaluateCommandTest, PairsByStampWhereBothFilesHaveStamps) {
  write("truth.txt", "# remark\n1.0 0 0 0 0 0 0 1\n2.0 1 0 0 0 0 0 1\n3.0 2 0 0 0 0 0 1\n");
  write("estimate.txt", "1.0 0 0 0 0 0 0 1\n3.01 2 0 0 0 0 0 1\n");
  const ProcessResult result = compare("--json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(nlohmann::json::parse(result.out).at("poses"), 2);
  EXPECT_NEAR(nlohmann::json::parse(result.out).at("ate_rmse_m"), 0.0, 1e-9);
}

TEST_F(EvaluateCommandTest, RefusesPoseFilesItCannotUse) {
  write("truth.txt", straight_path(3, 1.0));
  const std::vector<std::pair<std::string, std::string>> faults{
      {"", "estimate.txt"},
      {straight_path(2, 1.0), "3"},
      {"1 2 3\n", "estimate.txt"},
      {straight_path(2, 1.0) + "1 0 0 nan 0 1 0 0 0 0 1 0\n", "3"},
      {straight_path(2, 1.0) + "5 0 0 0 0 5 0 0 0 0 5 0\n", "3"},
      {"x 0 0 0 0 0 0 1\n", "line 1"},
      {"1.0 0 0 0 0 0 0 9\n", "line 1"},
      {std::string("\x00\xff\xfe rubbish", 11), "estimate.txt"}};
  for (const auto& [text, message] : faults) {
    write("estimate.txt", text);
    const ProcessResult result = compare();
    EXPECT_EQ(result.exit_code, 2) << text;
    EXPECT_THAT(result.err, HasSubstr(message)) << text;
  }
  std::filesystem::remove(folder_ / "estimate.txt");
  EXPECT_EQ(compare().exit_code, 2);
}

TEST_F(EvaluateCommandTest, ScoresSegmentationAgainstItself) {
  simulate("city", 2);
  const ProcessResult result = run("evaluate segmentation --json --truth " + path("city") +
                                   " --predictions " + path("city/labels"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_DOUBLE_EQ(json.at("miou_present"), 1.0);
  EXPECT_DOUBLE_EQ(json.at("iou").at("road"), 1.0);
  EXPECT_LT(json.at("miou"), 1.0);
}

TEST_F(EvaluateCommandTest, RunsTheNetworkOnAnImageOfTheWidthAskedFor) {
  simulate("city", 1);
  const std::string command = "evaluate segmentation --json --truth " + path("city");
  const auto accuracy = [&](const std::string& more) {
    const ProcessResult result = run(command + more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out).at("accuracy").get<double>();
  };
  const double wide = accuracy(" --columns 1024");
  EXPECT_EQ(accuracy(" --columns 1024"), wide);
  EXPECT_NE(accuracy(" --columns 128"), wide);
  EXPECT_GT(wide, 0.3);
  const ProcessResult odd = run(command + " --columns 1001");
  EXPECT_EQ(odd.exit_code, 2);
  EXPECT_THAT(odd.err, HasSubstr("1001"));
  EXPECT_EQ(run(command + " --columns 9000").exit_code, 2);
}

TEST_F(EvaluateCommandTest, ScansOfADriveVoteOnEachOthersLabels) {
  simulate("city", 8);
  const std::string command = "evaluate segmentation --json --columns 512 --truth " + path("city");
  const auto evaluated = [&](const std::string& more) {
    const ProcessResult result = run(command + more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out);
  };
  const nlohmann::json alone = evaluated(" --drive-votes off"), voted = evaluated("");
  EXPECT_EQ(voted.at("points"), alone.at("points"));
  EXPECT_GT(voted.at("accuracy"), alone.at("accuracy").get<double>() + 0.005);
  EXPECT_FALSE(alone.at("drive_votes").get<bool>());
  EXPECT_TRUE(voted.at("drive_votes").get<bool>());
  // Of one scan there are no others.
  EXPECT_EQ(evaluated(" --scans 1 --mirrored off").at("accuracy"),
            evaluated(" --scans 1 --drive-votes off").at("accuracy"));
  // Whoever lets the drive vote has time for the mirror, too.
  EXPECT_TRUE(voted.at("mirrored").get<bool>());
  EXPECT_FALSE(alone.at("mirrored").get<bool>());
  const nlohmann::json mirrored = evaluated(" --drive-votes off --mirrored on");
  EXPECT_TRUE(mirrored.at("mirrored").get<bool>());
  EXPECT_NE(mirrored.at("accuracy"), alone.at("accuracy"));
  // Scans without truth still tell where the others are.
  std::filesystem::remove(path("city/labels/000003.label"));
  const nlohmann::json fewer = evaluated("");
  EXPECT_LT(fewer.at("points"), voted.at("points"));
  EXPECT_GT(fewer.at("accuracy"), evaluated(" --drive-votes off").at("accuracy"));
  // Nor does it matter there that one is damaged.
  write("city/velodyne/000003.bin", "short");
  EXPECT_EQ(evaluated("").at("points"), fewer.at("points"));
  EXPECT_EQ(run(command + " --drive-votes maybe").exit_code, 2);
}

TEST_F(EvaluateCommandTest, BelievesTheMountAloneWhereAskedTo) {
  const std::string mount = " --mount 0,0,1.7,0,15,0";
  ASSERT_EQ(run("simulate " + path("leaning") + " --sensor vlp_16 --scans 1" + mount).exit_code, 0);
  const std::string command =
      "evaluate segmentation --json --columns 512 --truth " + path("leaning");
  const auto accuracy = [&](const std::string& more) {
    const ProcessResult result = run(command + more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out).at("accuracy").get<double>();
  };
  const double untold = accuracy(" --stance mount");
  EXPECT_GT(accuracy(""), untold + 0.1);
  EXPECT_GT(accuracy(" --stance mount" + mount), untold + 0.1);
  EXPECT_EQ(run(command + " --stance upright").exit_code, 2);
  for (const std::string stance : {"mount", "auto"}) {
    const ProcessResult both =
        run(command + " --predictions " + path("leaning/labels") + " --stance " + stance);
    EXPECT_EQ(both.exit_code, 2);
    EXPECT_THAT(both.err, HasSubstr("--stance"));
  }
  const ProcessResult mirrored =
      run(command + " --predictions " + path("leaning/labels") + " --mirrored on");
  EXPECT_EQ(mirrored.exit_code, 2);
  EXPECT_THAT(mirrored.err, HasSubstr("--mirrored"));
}

TEST_F(EvaluateCommandTest, TellsTheNetworkHowTheLidarLeans) {
  const std::string mount = " --mount 0,0,1.7,180,0,0";
  ASSERT_EQ(run("simulate " + path("hanging") + " --sensor vlp_16 --scans 1" + mount).exit_code, 0);
  const std::string command = "evaluate segmentation --json --truth " + path("hanging");
  const auto accuracy = [&](const std::string& more) {
    const ProcessResult result = run(command + more);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return nlohmann::json::parse(result.out).at("accuracy").get<double>();
  };
  EXPECT_GT(accuracy(mount), accuracy("") + 0.2);
  const ProcessResult both = run(command + mount + " --predictions " + path("hanging/labels"));
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_THAT(both.err, HasSubstr("--mount"));
}

TEST_F(EvaluateCommandTest, ScoresSeveralSequencesEachTogetherAndByRange) {
  simulate("city", 1);
  simulate("other", 1);
  const std::string truth = path("city") + " " + path("other");
  const ProcessResult result = run("evaluate segmentation --json --columns 512 --truth " + truth);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  ASSERT_EQ(json.at("sequences").size(), 2U);
  std::uint64_t points = 0, near_and_far = 0;
  for (const auto& one : json.at("sequences")) points += one.at("points").get<std::uint64_t>();
  for (const auto& band : json.at("by_range"))
    near_and_far += band.at("points").get<std::uint64_t>();
  EXPECT_EQ(json.at("points"), points);
  EXPECT_EQ(json.at("points"), near_and_far);
  EXPECT_GT(json.at("by_range").at(0).at("points"), 1000);
  const ProcessResult text = run("evaluate segmentation --columns 512 --truth " + truth);
  EXPECT_THAT(text.out,
              AllOf(HasSubstr("10-20 m"), HasSubstr("other"), HasSubstr("mean of groups")));
  const ProcessResult both =
      run("evaluate segmentation --truth " + truth + " --predictions " + path("city/labels"));
  EXPECT_EQ(both.exit_code, 2);
  EXPECT_THAT(both.err, HasSubstr("--truth names 2"));
}

TEST_F(EvaluateCommandTest, RefusesPredictionsOfClassesInsteadOfIds) {
  simulate("city", 1);
  const auto ids = read_kitti_labels(path("city/labels/000000.label"),
                                     content("city/labels/000000.label").size() / 4);
  std::vector<std::uint32_t> classes(ids.size(), 255);
  for (std::size_t i = 1; i < ids.size(); ++i)
    classes[i] = static_cast<std::uint32_t>(class_from_semantic_kitti(ids[i] & 0xFFFFU));
  std::filesystem::create_directories(folder_ / "classes");
  write_kitti_labels(path("classes/000000.label"), classes);
  const auto comparing = [&](const std::string& truth, const std::string& predictions) {
    return run("evaluate segmentation --truth " + path(truth) + " --predictions " +
               path(predictions));
  };
  EXPECT_EQ(comparing("city", "city/labels").exit_code, 0);
  for (const ProcessResult& refused :
       {comparing("city", "classes"), comparing("classes", "city/labels")}) {
    EXPECT_EQ(refused.exit_code, 2) << refused.out;
    EXPECT_THAT(refused.err, AllOf(HasSubstr("classes"), HasSubstr("remap_semantic_labels.py")));
  }
}

TEST_F(EvaluateCommandTest, RefusesPredictionsThatDoNotFit) {
  simulate("city", 2);
  const std::string command =
      "evaluate segmentation --truth " + path("city") + " --predictions " + path("predictions");
  EXPECT_EQ(run(command).exit_code, 2);
  std::filesystem::create_directories(folder_ / "predictions");
  EXPECT_EQ(run(command).exit_code, 2);
  write("predictions/000001.label", "1234");
  const ProcessResult too_short = run(command);
  EXPECT_EQ(too_short.exit_code, 2);
  EXPECT_THAT(too_short.err, HasSubstr("predictions/000001.label: holds 1 labels"));
  std::filesystem::rename(folder_ / "predictions/000001.label", folder_ / "predictions/9.label");
  EXPECT_THAT(run(command).err, HasSubstr("9.label"));
}

TEST_F(EvaluateCommandTest, ScoresAMapAgainstTheRecordingItWasMadeFrom) {
  simulate("city");
  ASSERT_EQ(run("map " + path("city") + " --out " + path("out")).exit_code, 0);
  const ProcessResult result =
      run("evaluate map --json --truth " + path("city") + " --map " + path("out/map.stillmap"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_GT(json.at("preservation_rate"), 0.3);
  EXPECT_LE(json.at("preservation_rate"), 1.0);
  EXPECT_GT(json.at("fixed_voxels"), 1000);
  EXPECT_GT(json.at("thin").at("pole").at("voxels"), 0);
  EXPECT_LE(json.at("thin").at("fence").at("voxels_kept"),
            json.at("thin").at("fence").at("voxels"));
}

TEST_F(EvaluateCommandTest, TakesTheMotionOutOfTheScansThatAMapIsScoredAgainst) {
  ASSERT_EQ(run("simulate " + path("city") + " --preset quiet --scans 6 --rolling").exit_code, 0);
  ASSERT_EQ(run("map " + path("city") + " --out " + path("out")).exit_code, 0);
  const ProcessResult result =
      run("evaluate map --json --truth " + path("city") + " --map " + path("out/map.stillmap"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GT(nlohmann::json::parse(result.out).at("preservation_rate"), 0.95);
}

TEST_F(EvaluateCommandTest, RefusesMapsThatAreNone) {
  simulate("city", 2);
  write("no_map", "this is no database");
  const std::string command = "evaluate map --truth " + path("city") + " --map ";
  EXPECT_EQ(run(command + path("missing")).exit_code, 2);
  EXPECT_FALSE(exists("missing"));
  const ProcessResult result = run(command + path("no_map"));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("no_map"));
}

TEST_F(EvaluateCommandTest, ComparesTheThreeWeightings) {
  simulate("city", 4);
  const ProcessResult result = run("evaluate weightings --json " + path("city"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json rows = nlohmann::json::parse(result.out);
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows.at(0).at("weighting"), "none");
  EXPECT_EQ(rows.at(2).at("weighting"), "semantic");
  EXPECT_DOUBLE_EQ(rows.at(0).at("error_reduction_factor"), 1.0);
  std::filesystem::remove(folder_ / "city/poses.txt");
  EXPECT_EQ(run("evaluate weightings " + path("city")).exit_code, 2);
}

constexpr const char* short_drive = "evaluate drives sim:yard,sensor=vlp_16,scans=14 --json";

TEST_F(EvaluateCommandTest, RunsDrivesWithEveryWeightingAndLabelSource) {
  for (const std::string labels : {"random30", "model"}) {
    const ProcessResult result =
        run(std::string(short_drive) + " --weightings none semantic --labels " + labels);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const nlohmann::json rows = nlohmann::json::parse(result.out);
    ASSERT_EQ(rows.size(), 2U);
    EXPECT_EQ(rows.at(1).at("weighting"), "semantic");
    EXPECT_EQ(rows.at(1).at("labels"), labels);
    EXPECT_EQ(rows.at(1).at("scans"), 14);
    EXPECT_EQ(rows.at(1).at("health").at("wrong"), 0);
    EXPECT_LT(rows.at(1).at("trajectory").at("ate_rmse_m"), 0.2);
    EXPECT_GT(rows.at(1).at("voxels"), 1000);
    EXPECT_GT(rows.at(1).at("p99_ms"), 0.0);
  }
}

TEST_F(EvaluateCommandTest, ComparesPosesAtOtherInstantsOfTheSweepWithTheTruthOfThen) {
  for (const std::string stamps : {"as_recorded", "end"}) {
    const ProcessResult result =
        run("evaluate drives sim:yard,sensor=vlp_16,scans=14,rolling,motion=hard_turns --json "
            "--stamps " +
            stamps);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const nlohmann::json row = nlohmann::json::parse(result.out).at(0);
    EXPECT_LT(row.at("trajectory").at("ate_rmse_m"), 0.015) << stamps;
  }
}

TEST_F(EvaluateCommandTest, CountsEveryPoseOfAnotherPlaceAsWrong) {
  const ProcessResult result = run(std::string(short_drive) + " --mutate other_place");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json row = nlohmann::json::parse(result.out).at(0);
  EXPECT_EQ(row.at("mutation"), "other_place");
  EXPECT_GE(row.at("health").at("wrong"), 7);
}

TEST_F(EvaluateCommandTest, TakesARecordingFromAScanOn) {
  simulate("city", 6);
  const ProcessResult result =
      run("evaluate drives " + path("city") + " --json --start 2 --scans 3 --mutate jitter");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json row = nlohmann::json::parse(result.out).at(0);
  EXPECT_EQ(row.at("scans"), 3);
  EXPECT_LT(row.at("trajectory").at("ate_rmse_m"), 0.2);
}

TEST_F(EvaluateCommandTest, NamesWhatADriveCannotBe) {
  simulate("city", 2);
  const std::vector<std::pair<std::string, std::string>> faults{
      {"sim:yard,seeds=3", "seeds=3"},
      {"sim:yard,seed=three", "seed=three"},
      {"sim:yard,traffic=crowd", "traffic=crowd"},
      {"sim:yard,traffic=11", "traffic is 11"},
      {"sim:village", "village"},
      {"sim:yard --mutate flood", "flood"},
      {"sim:yard --labels wrong", "wrong"},
      {path("city") + " --mutate other_place", "--other-place"},
      {path("city") + " --other-place " + path("city"), "--mutate other_place"},
      {path("missing"), "missing"}};
  for (const auto& [arguments, message] : faults) {
    const ProcessResult result = run("evaluate drives " + arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    EXPECT_THAT(result.err, HasSubstr(message)) << arguments;
  }
}

TEST_F(EvaluateCommandTest, RefusesDistancesAndTimesThatAreNone) {
  write("truth.txt", straight_path(20, 1.0));
  write("estimate.txt", straight_path(20, 1.0));
  for (const char* option :
       {"--max-difference nan", "--max-difference -1", "--max-difference 1e10"})
    EXPECT_EQ(compare(option).exit_code, 2) << option;
  for (const char* option : {"--max-range nan", "--max-range -5"}) {
    const ProcessResult refused = run(std::string("evaluate map --truth x --map y ") + option);
    EXPECT_EQ(refused.exit_code, 2) << option;
    EXPECT_THAT(refused.err, HasSubstr("--max-range")) << option;
  }
}

TEST_F(EvaluateCommandTest, PicturesNeedAFolder) {
  write("truth.txt", straight_path(20, 1.0));
  write("estimate.txt", straight_path(20, 1.0));
  const ProcessResult refused = compare("--pictures " + path("truth.txt"));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("--pictures " + path("truth.txt")), HasSubstr("name a folder")));
}

}  // namespace
}  // namespace stillmap::test
