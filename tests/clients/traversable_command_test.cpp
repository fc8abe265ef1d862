#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

class TraversableCommandTest : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    simulate("city");
    ASSERT_EQ(run("map " + path("city") + " --out " + path("out")).exit_code, 0);
  }
  [[nodiscard]] ProcessResult traversable(const std::string& more) const {
    return run("traversable " + path("out/map.stillmap") + " " + more);
  }
};

TEST_F(TraversableCommandTest, PrintsAreasByStateAndReason) {
  const ProcessResult result = traversable("");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("area for car"), HasSubstr("free"), HasSubstr("lethal: obstacle"),
                    HasSubstr("lethal: inflation"), HasSubstr("unknown")));
}

TEST_F(TraversableCommandTest, JsonHoldsTheSameFigures) {
  const ProcessResult result = traversable("--profile delivery_robot --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json report = nlohmann::json::parse(result.out);
  EXPECT_EQ(report.at("profile"), "delivery_robot");
  EXPECT_GT(report.at("free_m2"), 50.0);
  EXPECT_GE(report.at("free_m2"), report.at("inferred_m2"));
  EXPECT_GT(report.at("lethal_m2").at("obstacle"), 1.0);
  EXPECT_GT(report.at("ms_per_tile"), 0.0);
}

TEST_F(TraversableCommandTest, WritesNav2sFilesAndAPicture) {
  const ProcessResult result =
      traversable("--out " + path("nav2") + " --picture " + path("area.png"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(exists("area.png"));
  EXPECT_THAT(content("nav2/map.yaml"), HasSubstr("image: map.pgm"));
  EXPECT_TRUE(content("nav2/map.pgm").starts_with("P5\n"));
}

TEST_F(TraversableCommandTest, RefusesInputItCannotUse) {
  const auto refusal = [&](const std::string& arguments) {
    const ProcessResult result = run("traversable " + arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    return result.err;
  };
  const std::string map = path("out/map.stillmap");
  EXPECT_THAT(refusal(path("no.stillmap")), HasSubstr("no.stillmap"));
  EXPECT_FALSE(exists("no.stillmap"));
  EXPECT_THAT(refusal(map + " --profile submarine"), HasSubstr("submarine"));
  write("broken.yaml", "name: x\nwidth_m: -1\n");
  EXPECT_THAT(refusal(map + " --profile " + path("broken.yaml")), HasSubstr("width_m"));
  write("text.stillmap", "no database at all, but long enough to look at");
  EXPECT_THAT(refusal(path("text.stillmap")), HasSubstr("text.stillmap"));
}

}  // namespace
}  // namespace stillmap::test
