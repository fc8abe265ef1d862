#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

/// What one command takes in one spelling, all take in it.
class SpellingTest : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    simulate("city");
    ASSERT_EQ(run("map " + path("city") + " --output " + path("out")).exit_code, 0);
  }
  [[nodiscard]] std::string map() const { return path("out/map.stillmap"); }
  /// All print the same without an error.
  void expect_same(const std::vector<std::string>& spellings) const {
    const ProcessResult first = run(spellings.front());
    EXPECT_EQ(first.exit_code, 0) << spellings.front() << "\n" << first.err;
    for (const std::string& spelling : spellings) {
      const ProcessResult result = run(spelling);
      EXPECT_EQ(result.exit_code, 0) << spelling << "\n" << result.err;
      EXPECT_EQ(result.out, first.out) << spelling;
    }
  }
};

TEST_F(SpellingTest, AMapFileIsNamedByItsPlaceOrAsMap) {
  const std::vector<std::string> commands{"nearest --profile tracked --to 1 0",
                                          "check-path --profile tracked --path 1 0 3 0",
                                          "removed",
                                          "octomap --point 1 0 0",
                                          "map-info",
                                          "map-check",
                                          "sessions",
                                          "map-export -o " + path("part.ply")};
  for (const std::string& command : commands) {
    SCOPED_TRACE(command);
    expect_same({command + " --map " + map(), command + " " + map()});
  }
  const std::string plan = "plan --profile tracked --time-limit 60 --output " + path("path.csv");
  for (const std::string& spelling : {plan + " --map " + map() + " --from 1,0,0 --to 9,0",
                                      plan + " --from 1,0,0 --to 9,0 " + map()}) {
    const ProcessResult result = run(spelling);
    EXPECT_EQ(result.exit_code, 0) << spelling << result.err;
  }
}

TEST_F(SpellingTest, NumbersOfAPlaceStandApartOrWithCommas) {
  const std::string of_map = " --profile tracked --map " + map();
  expect_same({"nearest --to 1 -0.5" + of_map, "nearest --to 1,-0.5" + of_map});
  expect_same({"check-path --path 1 0 3 -0.5" + of_map, "check-path --path 1,0 3,-0.5" + of_map,
               "check-path --path 1,0,3,-0.5" + of_map});
  expect_same({"check-path --path 1 0 3 0 --headings 0 0.1" + of_map,
               "check-path --path 1 0 3 0 --headings 0,0.1" + of_map});
  expect_same(
      {"octomap --box -2 -2 0 2 2 2 --map " + map(), "octomap --box -2,-2,0,2,2,2 --map " + map()});
  for (const std::string region :
       {"--box %-2%-2%-3%2%2%2", "--around 0%0%4", "--sphere 0%0%0%4", "--polygon 0%0%4%0%4%4"}) {
    const auto with = [&](char between) {
      std::string text = region;
      for (char& letter : text) letter = letter == '%' ? between : letter;
      if (const std::size_t first = text.find(" ,"); first != std::string::npos)
        text.erase(first + 1, 1);
      return "map-export " + map() + " --out " + path("part.ply") + " " + text;
    };
    expect_same({with(' '), with(',')});
  }
}

TEST_F(SpellingTest, AStartAndAGoalMayBeInSeveralWords) {
  const std::string plan = "plan --profile tracked --time-limit 60 --map " + map();
  for (const char* goal :
       {" --from 1,0,0 --to 9,-0.5", " --from 1 0 0 --to 9 -0.5", " --to 9 -0.5 0 --from 1 0"}) {
    const ProcessResult result = run(plan + goal + " --out " + path("path.csv"));
    EXPECT_EQ(result.exit_code, 0) << goal << result.err;
    EXPECT_TRUE(content("path.csv").find("\n1.000,0.000") != std::string::npos) << goal;
  }
  const ProcessResult one = run(plan + " --from 1 0 0 --to 9");
  EXPECT_EQ(one.exit_code, 2);
  EXPECT_THAT(one.err, HasSubstr("must be x,y or x,y,heading"));
}

}  // namespace
}  // namespace stillmap::test
