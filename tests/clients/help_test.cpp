#include <array>

#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

constexpr std::array commands{"map",
                              "traversable",
                              "check-path",
                              "nearest",
                              "plan",
                              "removed",
                              "replay",
                              "record",
                              "watch",
                              "watch-tiles",
                              "query",
                              "octomap",
                              "status",
                              "health",
                              "doctor",
                              "security init",
                              "security add",
                              "security check",
                              "save",
                              "load",
                              "reset",
                              "map-info",
                              "merge",
                              "sessions",
                              "map-check",
                              "map-diff",
                              "map-export",
                              "simulate",
                              "simulate-training",
                              "evaluate trajectory",
                              "evaluate segmentation",
                              "evaluate map",
                              "evaluate weightings",
                              "dataset export",
                              "dataset aggregate",
                              "dataset scatter",
                              "dataset sensor",
                              "model info",
                              "model calibrate",
                              "model agree",
                              "model speed",
                              "model run"};

class HelpTest : public CommandTest {};

TEST_F(HelpTest, EveryCommandTeachesWithAnExample) {
  for (const std::string command : commands) {
    const ProcessResult result = run(command + " --help");
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

}  // namespace
}  // namespace stillmap::test
