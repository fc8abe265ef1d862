#include "clients/terminal/command_line.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "clients/commands/arguments/mount_arguments.hpp"

namespace stillmap::cli {
namespace {

using ::testing::ElementsAre;

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
