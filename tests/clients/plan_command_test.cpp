#include <algorithm>

#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

class PlanCommandTest : public CommandTest {
 protected:
  void make_map() const {
    simulate("city");
    ASSERT_EQ(run("map " + path("city") + " --out " + path("out")).exit_code, 0);
  }
  /// A small robot, for which the yard is large; the time limit leaves room on a busy machine.
  [[nodiscard]] std::string on_map() const {
    return "plan --map " + path("out/map.stillmap") + " --profile tracked --time-limit 60 ";
  }
};

TEST_F(PlanCommandTest, PlansOnAMapFilePrintsWritesAndDraws) {
  make_map();
  const ProcessResult result = run(on_map() + "--from 1,0,0 --to 9,0 --output " + path("path.csv") +
                                   " --picture " + path("path.png"));
  ASSERT_EQ(result.exit_code, 0) << result.err << result.out;
  EXPECT_THAT(result.out, AllOf(HasSubstr("heading deg"), HasSubstr("clearance"), HasSubstr("cost"),
                                HasSubstr("planned in")));
  EXPECT_TRUE(exists("path.png"));
  EXPECT_TRUE(content("path.csv").starts_with("x_m,y_m,z_m,heading_deg,along_m,reverse\n1.000,0."));
  EXPECT_GE(line_count("path.csv"), 20U);
  const ProcessResult json = run(on_map() + "--from 1,0,0 --to 9,0 --json");
  ASSERT_EQ(json.exit_code, 0) << json.err;
  const nlohmann::json plan = nlohmann::json::parse(json.out);
  EXPECT_EQ(plan.at("status"), "found");
  EXPECT_GE(plan.at("length_m"), 7.99);
  EXPECT_EQ(plan.at("path").size(), plan.at("poses"));
  EXPECT_EQ(plan.at("path").size() + 1, line_count("path.csv"));
}

TEST_F(PlanCommandTest, OnUnknownGroundHeightsAreNullAndEmpty) {
  make_map();
  const std::string beyond = on_map() + "--from 1,0,0 --to 9,400 --through-unknown ";
  const ProcessResult json = run(beyond + "--json --output " + path("path.csv"));
  ASSERT_EQ(json.exit_code, 0) << json.err << json.out;
  const nlohmann::json poses = nlohmann::json::parse(json.out).at("path");
  EXPECT_TRUE(std::any_of(poses.begin(), poses.end(),
                          [](const auto& pose) { return pose.at("z_m").is_number(); }));
  EXPECT_TRUE(poses.back().at("z_m").is_null());
  EXPECT_THAT(content("path.csv"), HasSubstr("\n9.000,400.000,,"));
}

TEST_F(PlanCommandTest, WithoutAPathItSaysWhyWithItsOwnExitCode) {
  make_map();
  const ProcessResult result =
      run("plan --profile car --map " + path("out/map.stillmap") + " --from 1,0,0 --to 900,0");
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_THAT(result.out, HasSubstr("blocked: 'car' cannot stand at"));
  EXPECT_EQ(run(on_map() + "--from 1,0,0 --to 1e9,0").exit_code, 2);
}

TEST_F(PlanCommandTest, WithoutAPathThatOfAnEarlierRunStays) {
  make_map();
  const std::string blocked =
      "plan --profile car --map " + path("out/map.stillmap") + " --from 1,0,0 --to 900,0";
  for (const char* name : {"path.csv", "path.json"}) {
    const std::string into = " --output " + path(name);
    ASSERT_EQ(run(blocked + into).exit_code, 4);
    EXPECT_FALSE(exists(name));
    ASSERT_EQ(run(on_map() + "--from 1,0,0 --to 9,0" + into).exit_code, 0);
    const std::string found = content(name);
    const ProcessResult none = run(blocked + into);
    EXPECT_EQ(none.exit_code, 4);
    EXPECT_THAT(none.err, HasSubstr("stays as it was"));
    EXPECT_EQ(content(name), found);
    EXPECT_FALSE(exists(std::string(name) + ".unfinished"));
  }
}

TEST_F(PlanCommandTest, RefusesWhatItCannotUseBeforeTheWork) {
  const auto refusal = [&](const std::string& arguments) {
    const ProcessResult result = run("plan " + arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    return result.err;
  };
  EXPECT_THAT(refusal("--from 0,0"), HasSubstr("--to"));
  EXPECT_THAT(refusal("--map no.stillmap --from 0,0 --to 3,3"), HasSubstr("no.stillmap"));
  EXPECT_THAT(refusal("--map x --from 0,0 --to 3"), HasSubstr("must be x,y or x,y,heading"));
  EXPECT_THAT(refusal("--map x --from 0,0,1,2 --to 3,3"), HasSubstr("--from 0,0,1,2"));
  EXPECT_THAT(refusal("--map x --from 0:0 --to 3,3"), HasSubstr("--from 0:0"));
  EXPECT_THAT(refusal("--map x --to 3,3 --output path.txt"), HasSubstr(".csv"));
  EXPECT_THAT(refusal("--map x --to 3,3 --picture path.jpg"), HasSubstr(".png"));
  EXPECT_THAT(refusal("--map x --to 3,3 --profile submarine"), HasSubstr("submarine"));
  EXPECT_THAT(refusal("--map x --to 3,3 --planner magic"), HasSubstr("--planner"));
  EXPECT_THAT(refusal("--map x --to 3,3 --seed 0"), HasSubstr("seed"));
  EXPECT_THAT(refusal("--map x --to 3,3 --follow"), HasSubstr("does not change"));
  EXPECT_THAT(refusal("--map x --to 3,3 --time 5"), HasSubstr("--time-limit"));
  EXPECT_THAT(refusal("--map x --to 3,3 --steps 5"), HasSubstr("--max-iterations"));
}

TEST_F(PlanCommandTest, FollowsTheMapOfAServerAndPlansAgainWhenItGrows) {
  simulate("city", 8);
  const std::string on_domain = " --domain " + std::to_string(free_domain());
  BackgroundProcess server(stillmap_server_program() + " --delivery every --map-file " +
                               path("server.stillmap") + on_domain,
                           folder_ / "server.log");
  ASSERT_EQ(run("status" + patiently() + on_domain).exit_code, 0) << content("server.log");
  BackgroundProcess planner(
      stillmap_program() + " plan --profile tracked --from 1,0,0 --to 6,0 --follow --count 2" +
          patiently("--duration") + " --json --output " + path("path.json") + on_domain,
      folder_ / "plan.log");
  ASSERT_EQ(run("replay " + path("city") + " --lossless" + patiently() + on_domain).exit_code, 0);
  EXPECT_EQ(planner.wait(), 0) << content("plan.log");
  const nlohmann::json plan = nlohmann::json::parse(content("path.json"));
  EXPECT_EQ(plan.at("status"), "found");
  EXPECT_FALSE(plan.at("cause").get<std::string>().empty());
  // From the robot's pose at the end of the replay.
  const ProcessResult again = run("plan --profile tracked --to 1,0" + patiently() + on_domain);
  EXPECT_EQ(again.exit_code, 0) << again.out << again.err;
  EXPECT_EQ(server.stop(), 0);
}

}  // namespace
}  // namespace stillmap::test
