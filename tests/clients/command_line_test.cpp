#include "clients/terminal/command_line.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iostream>
#include <limits>
#include <sstream>
#include <streambuf>
#include <string>
#include <vector>

#include "clients/commands/arguments/mount_arguments.hpp"
#include "clients/commands/command.hpp"

namespace stillmap::cli {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double infinity = std::numeric_limits<double>::infinity();

CommandLine::Parsed parse(CommandLine& line, std::vector<std::string> words) {
  words.insert(words.begin(), "program");
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  return line.parse(static_cast<int>(argv.size()), argv.data());
}

TEST(CommandLine, TakesNegativeNumbersOfEveryKindForValues) {
  CommandLine line("program", "1", "help");
  std::vector<double> box;
  std::vector<double> point;
  double low = 0.0;
  line.root().option("--box", box, "").exactly(4);
  line.root().option("--point", point, "").exactly(2).comma_separated();
  line.root().option("--low", low, "");
  ASSERT_EQ(parse(line, {"--box", "-inf", "-Infinity", "-.5", "-2", "--point", "-INF,3", "--low",
                         "-infinity"}),
            CommandLine::Parsed::command);
  EXPECT_THAT(box, ElementsAre(-infinity, -infinity, -0.5, -2.0));
  EXPECT_THAT(point, ElementsAre(-infinity, 3.0));
  EXPECT_EQ(low, -infinity);
}

TEST(CommandLine, OtherWordsWithAMinusStayOptions) {
  for (const char* word : {"-information", "-i", "--inf", "-"}) {
    CommandLine line("program", "1", "help");
    std::vector<double> box;
    line.root().option("--box", box, "").exactly(2);
    EXPECT_EQ(parse(line, {"--box", "1", word}), CommandLine::Parsed::wrong_usage) << word;
  }
}

// "$MAP" of a script that never set it: the server's map was taken instead.
TEST(CommandLine, RefusesEmptyTexts) {
  for (const std::vector<std::string>& words : {std::vector<std::string>{""},
                                                {"a", "--map", ""},
                                                {"a", "--map="},
                                                {"a", "--topics", "b", ""},
                                                {"a", "--none", "", "--map", ""}}) {
    CommandLine line("program", "1", "help");
    std::string place, map, none = "imu";
    std::vector<std::string> topics;
    line.root().option("PLACE", place, "");
    line.root().option("--map", map, "");
    line.root().option("--topics", topics, "");
    line.root().option("--none", none, "").or_empty();
    EXPECT_EQ(parse(line, words), CommandLine::Parsed::wrong_usage)
        << testing::PrintToString(words);
  }
  CommandLine line("program", "1", "help");
  std::string none = "imu";
  line.root().option("--none", none, "").or_empty();
  EXPECT_EQ(parse(line, {"--none", ""}), CommandLine::Parsed::command);
  EXPECT_EQ(none, "");
}

TEST(CommandLine, AListOfNumbersEndsBeforeALastWordThatIsNone) {
  const std::vector<std::vector<std::string>> spellings{
      {"ask", "city.map", "--path", "0", "0", "-3", "4.5"},
      {"ask", "--path", "0", "0", "-3", "4.5", "city.map"},
      {"ask", "--path", "0,0", "-3,4.5", "city.map", "--json"},
      {"ask", "--at", "1", "-2", "city.map", "--path", "0", "0", "-3", "4.5"},
      {"ask", "--to", "1,-2", "city.map", "--path", "0", "0", "-3", "4.5"},
      {"ask", "--path", "0,0,-3,4.5", "--map", "city.map"}};
  for (const std::vector<std::string>& words : spellings) {
    CommandLine line("program", "1", "help");
    std::string map;
    std::vector<double> path;
    std::vector<std::string> to;
    std::vector<double> at;
    bool json = false;
    CommandHandle ask = line.root().command("ask", "");
    ask.option("MAPFILE,--map", map, "");
    ask.option("--path", path, "").comma_separated();
    ask.option("--to", to, "").up_to(3);
    ask.option("--at", at, "").exactly(2).comma_separated();
    ask.flag("--json", json, "");
    ASSERT_EQ(parse(line, words), CommandLine::Parsed::command) << words[1];
    EXPECT_EQ(map, "city.map");
    EXPECT_THAT(path, ElementsAre(0.0, 0.0, -3.0, 4.5));
  }
}

TEST(CommandLine, WordsOfAListStayInIt) {
  CommandLine line("program", "1", "help");
  std::string map;
  std::vector<std::string> classes, points;
  line.root().option("MAPFILE", map, "");
  line.root().option("--classes", classes, "");
  line.root().option("--points", points, "");
  ASSERT_EQ(parse(line, {"--classes", "road", "sidewalk", "--points", "0", "x", "1"}),
            CommandLine::Parsed::command);
  EXPECT_THAT(classes, ElementsAre("road", "sidewalk"));
  EXPECT_THAT(points, ElementsAre("0", "x", "1"));
  EXPECT_EQ(map, "");
}

TEST(CommandLine, AFileNameEndsAsItMust) {
  for (const char* name : {"map.png", "map.jpg", "png"}) {
    CommandLine line("program", "1", "help");
    std::string picture;
    line.root().option("--picture", picture, "").ends_in(".png");
    const bool is_right = std::string(name) == "map.png";
    EXPECT_EQ(parse(line, {"--picture", name}),
              is_right ? CommandLine::Parsed::command : CommandLine::Parsed::wrong_usage)
        << name;
  }
}

/// What is printed of wrong usage.
std::string fault_of(const std::vector<std::string>& words) {
  CommandLine line("program", "1", "help");
  double scale = 1.0;
  int domain = 0;
  line.root().require_command();
  CommandHandle map = line.root().command("map", "");
  map.option("--scale,--peer", scale, "");
  map.option("--domain", domain, "").from_environment("STILLMAP_TEST_DOMAIN").between(0, 10);
  line.root().command("replay", "").command("again", "");
  std::string as;
  line.root().command("save", "").option("--as", as, "").required();
  testing::internal::CaptureStderr();
  const CommandLine::Parsed parsed = parse(line, words);
  const std::string fault = testing::internal::GetCapturedStderr();
  EXPECT_EQ(parsed, CommandLine::Parsed::wrong_usage);
  return fault;
}

TEST(CommandLine, NamesWhatWasMeant) {
  EXPECT_THAT(fault_of({"mpa"}), HasSubstr("Did you mean 'map'?"));
  EXPECT_THAT(fault_of({"replya", "x"}), HasSubstr("Did you mean 'replay'?"));
  EXPECT_THAT(fault_of({"map", "--scael", "2"}), HasSubstr("Did you mean '--scale'?"));
  EXPECT_THAT(fault_of({"map", "--scales=2"}), HasSubstr("Did you mean '--scale'?"));
  for (const std::vector<std::string>& words : {std::vector<std::string>{"segment"},
                                                {"top"},
                                                {"simulate", "--gpu"},
                                                {},
                                                {"map", "--width", "2"},
                                                {"map", "--other"},
                                                {"map", "x"}}) {
    EXPECT_THAT(fault_of(words), Not(HasSubstr("Did you mean")));
  }
}

TEST(CommandLine, NamesWhatMeansNothingInTheOrderInWhichItStands) {
  EXPECT_THAT(fault_of({"segment"}), HasSubstr("no command 'segment'"));
  EXPECT_THAT(fault_of({"replay", "later"}), HasSubstr("not expected here: later\n"));
  EXPECT_THAT(fault_of({"map", "--width", "2", "--x=3"}),
              HasSubstr("not expected here: --width 2 --x=3\n"));
  EXPECT_THAT(fault_of({}), HasSubstr("A subcommand is required"));
  EXPECT_THAT(fault_of({"save", "here", "there"}), HasSubstr("--as is required"));
}

TEST(CommandLine, NamesTheVariableThatAWrongValueCameFrom) {
  ASSERT_EQ(setenv("STILLMAP_TEST_DOMAIN", "11", 1), 0);
  EXPECT_THAT(fault_of({"map"}), HasSubstr("--domain is taken from the environment's "
                                           "STILLMAP_TEST_DOMAIN=11"));
  EXPECT_THAT(fault_of({"map", "--domain", "12"}), Not(HasSubstr("environment")));
  unsetenv("STILLMAP_TEST_DOMAIN");
}

/// As of a full disk.
class NoRoom : public std::streambuf {
 protected:
  int overflow(int /*byte*/) override { return traits_type::eof(); }
  int sync() override { return -1; }
};

TEST(Program, FailsWhereItsHelpCannotBeWritten) {
  NoRoom full;
  std::streambuf* const stdout_before = std::cout.rdbuf(&full);
  CommandLine line("program", "1", "help");
  std::vector<std::string> words{"program", "--help"};
  std::vector<char*> argv{words[0].data(), words[1].data()};
  bool was_run = false;
  const int exit_code = run_program(line, 2, argv.data(), [&] {
    was_run = true;
    return ExitCode::ok;
  });
  std::cout.rdbuf(stdout_before);
  std::cout.clear();
  EXPECT_EQ(exit_code, static_cast<int>(ExitCode::failed));
  EXPECT_FALSE(was_run);
}

TEST(CommandLine, WrapsExplanationsButNoExample) {
  CommandLine line("program", "1", "help");
  const std::string example = "  program " + std::string(200, 'x') + " --out file";
  std::string words = "word";
  while (words.size() < 250) words += " word";
  line.root().explain("Examples:\n" + example + "\n" + words + "\nShort lines stay apart.\nSo.");
  testing::internal::CaptureStdout();
  ASSERT_EQ(parse(line, {"--help"}), CommandLine::Parsed::answered);
  std::istringstream help(testing::internal::GetCapturedStdout());
  std::vector<std::string> lines;
  for (std::string one; std::getline(help, one);) lines.push_back(one);
  EXPECT_THAT(lines,
              AllOf(Contains(example), Contains("Short lines stay apart."), Contains("So.")));
  std::string joined;
  for (const std::string& one : lines) {
    if (!one.starts_with("word")) continue;
    EXPECT_LE(one.size(), 92U);
    joined += (joined.empty() ? "" : " ") + one;
  }
  EXPECT_EQ(joined, words);
}

TEST(FrameOption, GoesWithoutItsFirstSlash) {
  for (const char* given : {"/velodyne", "velodyne"}) {
    CommandLine line("program", "1", "help");
    std::string frame = "lidar";
    add_frame_option(line.root(), "--frame", frame, "");
    ASSERT_EQ(parse(line, {"--frame", given}), CommandLine::Parsed::command) << given;
    EXPECT_EQ(frame, "velodyne");
  }
  for (const char* given : {"//velodyne", "/"}) {
    CommandLine line("program", "1", "help");
    std::string frame = "lidar";
    add_frame_option(line.root(), "--frame", frame, "");
    EXPECT_EQ(parse(line, {"--frame", given}), CommandLine::Parsed::wrong_usage) << given;
  }
}

}  // namespace
}  // namespace stillmap::cli
