#include <sstream>
#include <string>
#include <vector>

#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

/// Those that a help lists, in front of which stands `before`.
std::vector<std::string> listed_commands(const std::string& help, const std::string& before) {
  std::vector<std::string> commands;
  std::istringstream lines(help);
  std::string line;
  while (std::getline(lines, line) && line != "Subcommands:") {
  }
  while (std::getline(lines, line) && line.starts_with("  ")) {
    std::string name;
    std::istringstream(line) >> name;
    commands.push_back(before + name);
  }
  return commands;
}

class HelpTest : public CommandTest {};

TEST_F(HelpTest, EveryCommandTeachesWithAnExample) {
  std::vector<std::string> commands = listed_commands(run("--help").out, "");
  EXPECT_GT(commands.size(), 30U);
  for (std::size_t i = 0; i < commands.size(); ++i) {
    const std::string command = commands[i];
    const ProcessResult result = run(command + " --help");
    const auto parts = listed_commands(result.out, command + " ");
    commands.insert(commands.end(), parts.begin(), parts.end());
    if (!parts.empty()) continue;
    EXPECT_EQ(result.exit_code, 0) << command;
    EXPECT_THAT(result.out, AllOf(HasSubstr("Example"), HasSubstr("  stillmap " + command)));
    EXPECT_EQ(result.err, "") << command;
  }
}

TEST_F(HelpTest, TheProgramListsItsCommandsAndExitCodes) {
  const ProcessResult result = run("--help");
  EXPECT_EQ(result.exit_code, 0);
  for (const std::string command :
       {"map", "replay", "watch", "query", "evaluate", "simulate", "dataset"}) {
    EXPECT_THAT(result.out, HasSubstr("\n  " + command + " "));
  }
  EXPECT_THAT(result.out, HasSubstr("Exit codes"));
}

TEST_F(HelpTest, VersionIsANumber) {
  const ProcessResult result = run("--version");
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.out, testing::MatchesRegex("[0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST_F(HelpTest, WrongUsageIsExitCodeTwoAndSaysWhatIsWrong) {
  EXPECT_EQ(run("").exit_code, 2);
  EXPECT_EQ(run("fly").exit_code, 2);
  EXPECT_EQ(run("evaluate").exit_code, 2);
  EXPECT_EQ(run("map").exit_code, 2);
  const ProcessResult result = run("map somewhere --speed 3");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--speed"));
}

TEST_F(HelpTest, NumbersBelowZeroAreRefusedWhereThereAreNone) {
  for (const auto& [command, option] :
       {std::pair("query --since-version -1", "--since-version"),
        std::pair("map x --scans -1", "--scans"), std::pair("map x --start ' -1'", "--start"),
        std::pair("plan --to 1,1 --max-iterations -1", "--max-iterations"),
        std::pair("octomap --max-voxels -1", "--max-voxels"),
        std::pair("watch --count -1", "--count")}) {
    const ProcessResult result = run(command);
    EXPECT_EQ(result.exit_code, 2) << command;
    EXPECT_THAT(result.err, AllOf(HasSubstr(option), HasSubstr("-1' is negative"))) << command;
  }
}

TEST_F(HelpTest, TimesHaveLimitsThatTheHelpShows) {
  EXPECT_THAT(run("status --help").out, HasSubstr("above 0 to 86400"));
  for (const char* command :
       {"status --timeout 1e17", "status --timeout nan", "status --timeout inf",
        "map x --save-period 1e10", "doctor --listen 1e17",
        "dataset export x y --idle-timeout 1e17", "plan --to 1,1 --time-limit inf"}) {
    const ProcessResult result = run(command);
    EXPECT_EQ(result.exit_code, 2) << command;
    EXPECT_THAT(result.err, HasSubstr("must be a finite number above zero")) << command;
    EXPECT_LT(result.err.size(), 200U) << result.err;
  }
}

TEST_F(HelpTest, PlacesThatAreNoneAreWrongUsage) {
  for (const auto& [command, named] :
       {std::pair("locate --near nan 0 0", "--near"), std::pair("locate --near 0 0 inf", "--near"),
        std::pair("locate --near 0 0 0 --radius 1e300", "--radius"),
        std::pair("locate --near 0 0 0 --max-turn nan", "--max-turn")}) {
    const ProcessResult result = run(command);
    EXPECT_EQ(result.exit_code, 2) << command;
    EXPECT_THAT(result.err, HasSubstr(named)) << command;
    EXPECT_LT(result.err.size(), 200U) << result.err;
  }
}

TEST_F(HelpTest, WhatSaysNothingAloneNamesWhatItNeeds) {
  for (const auto& [command, needed] :
       {std::pair("sessions x --out y", "--withdraw"),
        std::pair("sessions x --force", "--withdraw"), std::pair("query --width 3", "--corridor"),
        std::pair("traversable --width 3", "--corridor"),
        std::pair("map-export x -o y.ply --width 3", "--corridor"),
        std::pair("map-export x -o y.ply --outlier-neighbours 4", "--remove-outliers"),
        std::pair("query --since-map 3", "--since-version"),
        std::pair("plan --to 1,1 --count 3", "--follow"),
        std::pair("plan --to 1,1 --duration 3", "--follow"),
        std::pair("octomap --resolution 0.5", "--map"),
        std::pair("octomap --max-range 20", "--ray"),
        std::pair("octomap --through-unknown", "--ray"),
        std::pair("octomap --max-voxels 3", "--box"),
        std::pair("traversable --min-outline-area 2", "--outlines"),
        std::pair("simulate x --gnss-delay 0.1", "--gnss"),
        std::pair("replay x --base robot", "--mount"),
        std::pair("dataset sensor x --scans 50", "--calibrate")}) {
    const ProcessResult result = run(command);
    EXPECT_EQ(result.exit_code, 2) << command;
    EXPECT_THAT(result.err, HasSubstr(std::string("requires ") + needed)) << command;
  }
}

TEST_F(HelpTest, WhatSaysNothingOfLabelsInFilesIsRefused) {
  for (const std::string option : {"--model street", "--drive-votes off", "--picture x.png"}) {
    const ProcessResult result = run("evaluate segmentation --truth x --predictions y " + option);
    EXPECT_EQ(result.exit_code, 2) << option;
    EXPECT_THAT(result.err,
                HasSubstr("--predictions excludes " + option.substr(0, option.find(' '))));
  }
}

TEST_F(HelpTest, WhatSaysNothingOfALiveTopicIsRefused) {
  for (const std::string option : {"--start 3", "--strict", "--topic-in points",
                                   "--label-kind classes", "--drive-votes off", "--mirrored on"}) {
    const ProcessResult result = run("dataset export topic:points x " + option);
    EXPECT_EQ(result.exit_code, 2) << option;
    EXPECT_THAT(result.err, HasSubstr(option.substr(0, option.find(' ')) + " is of recordings"));
  }
}

TEST_F(HelpTest, AMapFileThatIsNotThereIsNamedAlikeByAll) {
  const std::string file = path("none.stillmap");
  for (const std::string& command :
       {"map-info " + file, "map-check " + file, "sessions " + file, "removed " + file,
        "traversable " + file, "octomap --map " + file, "map-export -o x.ply " + file,
        "plan --from 0,0 --to 1,1 --map " + file, "nearest --to 1 0 --map " + file,
        "check-path --path 0 0 1 0 --map " + file, "evaluate traversable --map " + file,
        "evaluate map --truth x --map " + file, "localize " + file + " drive",
        "merge " + file + " other --out " + path("both.stillmap")}) {
    const ProcessResult result = run(command);
    EXPECT_EQ(result.exit_code, 2) << command;
    EXPECT_THAT(result.err, HasSubstr("none.stillmap: is not there; name a map file")) << command;
  }
}

TEST_F(HelpTest, CloudsToBeLabelledArePlyFiles) {
  const ProcessResult result = run("dataset aggregate city cloud.txt");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("'cloud.txt' must end in .ply"));
}

TEST_F(HelpTest, LoadSaysWhenTheRunningMapIsNotSaved) {
  EXPECT_THAT(run("load --help").out, HasSubstr("what was saved there last"));
}

TEST_F(HelpTest, TopicNamesGoWithoutTheirFirstSlashAndTheRestIsRefused) {
  for (const auto& [command, refused] :
       {std::pair("record x --points a//b", "--points: 'a//b'"),
        std::pair("record x --imu ''", "--imu: ''"),
        std::pair("replay x --topic points/", "--topic: 'points/'"),
        std::pair("replay x --gnss-topic //fix", "--gnss-topic: '//fix'"),
        std::pair("doctor --points 'a b'", "--points: 'a b'"),
        std::pair("security init x --imu 'imu data'", "--imu: 'imu data'"),
        std::pair("security init x --server /bot/", "--server: '/bot/'"),
        std::pair("status --server /bot/", "--server: '/bot/'"),
        std::pair("dataset export topic:a//b x", "topic:a//b: 'a//b'")}) {
    const ProcessResult result = run(command);
    EXPECT_EQ(result.exit_code, 2) << command;
    EXPECT_THAT(result.err, HasSubstr(std::string(refused) + " is no topic name")) << command;
  }
  const ProcessResult made =
      run("security init " + path("keys") + " --points /front/points --imu '' --server /bot");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto names = nlohmann::json::parse(content("keys/authority/topics.json"));
  EXPECT_EQ(names.at("points"), "front/points");
  EXPECT_EQ(names.at("imu"), "");
  EXPECT_EQ(names.at("namespace"), "bot");
}

TEST_F(HelpTest, EmptyNamesAreRefusedWhereTheyWouldMeanSomethingElse) {
  for (const char* command :
       {"loops ''", "plan --map '' --from 0,0,0 --to 1,1", "octomap --map x --output ''",
        "simulate ''", "map city --onto ''", "query --around-robot 5 --out ''"}) {
    const ProcessResult result = run(command);
    EXPECT_EQ(result.exit_code, 2) << command;
    EXPECT_THAT(result.err, HasSubstr("is empty")) << command;
  }
}

TEST_F(HelpTest, SecurityTakesTheTopicsOfSeveralLidars) {
  const std::string init = "security init " + path("keys");
  for (const auto& [points, refused] :
       {std::pair(" --points /a/points b a/points", "--points names 'a/points' twice"),
        std::pair(" --points a ''", "--points: '' is no topic name"),
        std::pair(" --points a b//c", "--points: 'b//c' is no topic name"),
        std::pair(" --points", "--points: 1 required")}) {
    const ProcessResult result = run(init + points);
    EXPECT_EQ(result.exit_code, 2) << points;
    EXPECT_THAT(result.err, HasSubstr(refused)) << points;
    EXPECT_FALSE(exists("keys")) << points;
  }
  const ProcessResult made = run(init + " --points front/points /rear/points --days 30");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  for (const char* identity : {"server", "sensor", "planner", "operator"}) {
    EXPECT_THAT(content(std::string("keys/") + identity + "/permissions.p7s"),
                AllOf(HasSubstr("rt/front/points"), HasSubstr("rt/rear/points")))
        << identity;
  }
}

TEST_F(HelpTest, SecurityKeepsOneTopicOrSeveralForLaterIdentities) {
  ASSERT_EQ(run("security init " + path("keys") + " --points front/points rear/points").exit_code,
            0);
  const std::string file = "keys/authority/topics.json";
  EXPECT_EQ(nlohmann::json::parse(content(file)).at("points"),
            nlohmann::json::array({"front/points", "rear/points"}));
  const std::string add = "security add " + path("keys") + " ";
  const ProcessResult of_several = run(add + "several --role sensor");
  EXPECT_EQ(of_several.exit_code, 0) << of_several.err;
  EXPECT_THAT(content("keys/several/permissions.p7s"),
              AllOf(HasSubstr("rt/front/points"), HasSubstr("rt/rear/points")));

  const std::string rest = R"(, "odometry_prior": "", "namespace": "stillmap"})";
  write(file, R"({"points": "top/points")" + rest);
  const ProcessResult of_one = run(add + "one --role sensor");
  EXPECT_EQ(of_one.exit_code, 0) << of_one.err;
  EXPECT_THAT(content("keys/one/permissions.p7s"),
              AllOf(HasSubstr("rt/top/points"), testing::Not(HasSubstr("rt/front/points"))));

  for (const auto& [points, refused] : {std::pair("[]", "'points' names no topic"),
                                        std::pair(R"(["a", "a"])", "'points' names 'a' twice"),
                                        std::pair("7", "does not name the topics")}) {
    write(file, R"({"points": )" + std::string(points) + rest);
    const ProcessResult result = run(add + "none --role sensor");
    EXPECT_EQ(result.exit_code, 2) << points;
    EXPECT_THAT(result.err, AllOf(HasSubstr("topics.json"), HasSubstr(refused))) << points;
    EXPECT_FALSE(exists("keys/none")) << points;
  }
}

}  // namespace
}  // namespace stillmap::test
