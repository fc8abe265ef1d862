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

}  // namespace
}  // namespace stillmap::test
