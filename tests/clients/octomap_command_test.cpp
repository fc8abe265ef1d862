#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

class OctomapCommandTest : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    simulate("city");
    ASSERT_EQ(run("map " + path("city") + " --out " + path("out")).exit_code, 0);
  }
  [[nodiscard]] ProcessResult octomap(const std::string& more) const {
    return run("octomap --map " + path("out/map.stillmap") + " " + more);
  }
};

TEST_F(OctomapCommandTest, WritesBothKindsOfAStoredMapAndReadsThemBack) {
  for (const std::string file : {"map.bt", "map.ot"}) {
    const ProcessResult written = octomap("--json --output " + path(file));
    ASSERT_EQ(written.exit_code, 0) << written.err;
    const ProcessResult read = run("octomap --json --map " + path(file));
    ASSERT_EQ(read.exit_code, 0) << read.err;
    const nlohmann::json before = nlohmann::json::parse(written.out).at("octomap");
    const nlohmann::json after = nlohmann::json::parse(read.out).at("octomap");
    EXPECT_GT(before.at("occupied"), 1000);
    EXPECT_EQ(after.at("occupied"), before.at("occupied"));
    EXPECT_EQ(after.at("free"), 0);
  }
}

TEST_F(OctomapCommandTest, AnswersPointsBoxesAndRays) {
  const ProcessResult result = octomap(
      "--point -5,0,30 --point 1,2,3 --box -50,-50,-5,50,50,15 --ray 0,0,0.2,0,0,-1 "
      "--through-unknown --max-voxels 3 --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json answers = nlohmann::json::parse(result.out).at("answers");
  EXPECT_EQ(answers.at("points").size(), 2U);
  EXPECT_EQ(answers.at("points").at(0).at("occupancy"), "unknown");
  EXPECT_GT(answers.at("boxes").at(0).at("occupied"), 1000);
  EXPECT_EQ(answers.at("boxes").at(0).at("occupied_voxels").size(), 3U);
  EXPECT_EQ(answers.at("rays").size(), 1U);
  EXPECT_THAT(octomap("--point nan,0,0 --point 1,1,1").out,
              AllOf(HasSubstr("cannot be asked: point is nan"), HasSubstr("1.00, 1.00, 1.00: ")));
}

TEST_F(OctomapCommandTest, RefusesWhatItCannotUse) {
  const auto refusal = [&](const std::string& arguments) {
    const ProcessResult result = run("octomap " + arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    return result.err;
  };
  EXPECT_THAT(refusal("--map " + path("none.stillmap")), HasSubstr("none.stillmap"));
  EXPECT_FALSE(exists("none.stillmap"));
  const std::string map = "--map " + path("out/map.stillmap");
  EXPECT_THAT(refusal(map + " --output map.ply"), HasSubstr("must end in .bt"));
  EXPECT_THAT(refusal(map + " --output " + path("no/map.bt")), HasSubstr("cannot be written"));
  EXPECT_THAT(refusal(map + " --point 1,2"), HasSubstr("--point has 2 numbers"));
  EXPECT_THAT(refusal(map + " --resolution 0"), HasSubstr("--resolution"));
  EXPECT_THAT(refusal(map + " --resolution 0.01"),
              HasSubstr("--resolution is 0.010; it must be 0.02 to 10 m"));
  write("broken.bt", "# Octomap OcTree binary file\nid OcTree\nsize 9\nres 0.2\ndata\nxx");
  EXPECT_THAT(refusal("--map " + path("broken.bt")),
              AllOf(HasSubstr("broken.bt"), HasSubstr("damaged")));
}

TEST_F(OctomapCommandTest, WhatCannotBeAskedIsExitCodeTwo) {
  for (const char* question : {"--point nan,0,0", "--box 1,1,1,-1,-1,-1", "--ray 0,0,0,0,0,0",
                               "--box -1e6,-1e6,-1e6,1e6,1e6,1e6", "--point 1e300,0,0"}) {
    const ProcessResult refused = octomap(std::string(question) + " --point 1,1,1");
    EXPECT_EQ(refused.exit_code, 2) << question;
    EXPECT_THAT(refused.out, AllOf(HasSubstr("cannot be asked"), HasSubstr("1.00, 1.00, 1.00: ")));
    EXPECT_LT(refused.out.size(), 400U) << refused.out;
  }
  const ProcessResult json = octomap("--point nan,0,0 --json");
  EXPECT_EQ(json.exit_code, 2);
  const nlohmann::json answers = nlohmann::json::parse(json.out).at("answers");
  EXPECT_THAT(answers.at("points").at(0).at("fault"), HasSubstr("nan"));
}

TEST_F(OctomapCommandTest, AnOctomapFileHasAResolutionOfItsOwn) {
  ASSERT_EQ(octomap("--resolution 0.4 --output " + path("map.bt")).exit_code, 0);
  const ProcessResult refused = run("octomap --resolution 0.2 --map " + path("map.bt"));
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("--resolution"), HasSubstr("map.bt")));
}

}  // namespace
}  // namespace stillmap::test
