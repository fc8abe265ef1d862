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
                    HasSubstr("lethal: inscribed"), HasSubstr("unknown")));
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

TEST_F(TraversableCommandTest, KeepsToARegionAndWritesItsOutlines) {
  const nlohmann::json all = nlohmann::json::parse(traversable("--json").out);
  const ProcessResult result = traversable("--around-robot 20 --json --min-outline-area 2 --out " +
                                           path("nav2") + " --outlines " + path("free.json"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json near = nlohmann::json::parse(result.out);
  EXPECT_GT(near.at("free_m2"), 10.0);
  EXPECT_LT(near.at("free_m2"), all.at("free_m2"));
  EXPECT_TRUE(content("nav2/map.pgm").starts_with("P5\n100 100\n") ||
              content("nav2/map.pgm").starts_with("P5\n101 101\n"));
  const nlohmann::json outlines = nlohmann::json::parse(content("free.json"));
  EXPECT_EQ(outlines.at("type"), "FeatureCollection");
  ASSERT_GT(outlines.at("features").size(), 0U);
  for (const nlohmann::json& feature : outlines.at("features")) {
    EXPECT_GE(feature.at("properties").at("area_m2"), 2.0);
    for (const nlohmann::json& ring : feature.at("geometry").at("coordinates")) {
      EXPECT_GT(ring.size(), 3U);
      EXPECT_EQ(ring.front(), ring.back());
    }
  }
}

TEST_F(TraversableCommandTest, FindsAPlaceAndChecksPathsFromThere) {
  const std::string map = path("out/map.stillmap");
  const ProcessResult nearest = run("nearest " + map + " --profile delivery_robot --to 3 0 --json");
  ASSERT_EQ(nearest.exit_code, 0) << nearest.err;
  const nlohmann::json place = nlohmann::json::parse(nearest.out);
  EXPECT_GE(place.at("distance_m"), 0.0);
  const std::string start =
      place.at("position").at(0).dump() + " " + place.at("position").at(1).dump();
  const std::string check = "check-path " + map + " --profile delivery_robot --path " + start;
  const ProcessResult far = run(check + " 300 0 --json");
  EXPECT_EQ(far.exit_code, 1) << far.err;
  const nlohmann::json conflict = nlohmann::json::parse(far.out).at("conflict");
  EXPECT_EQ(conflict.at("segment"), 0);
  EXPECT_FALSE(conflict.at("reason").empty());
  EXPECT_THAT(run(check + " 300 0").out, HasSubstr("blocked for delivery_robot after"));
  EXPECT_EQ(run("nearest " + map + " --to 3000 0 --max-distance 5").exit_code, 1);
}

TEST_F(TraversableCommandTest, RefusesPathsAndPlacesThatAreNone) {
  const auto refusal = [&](const std::string& arguments) {
    const ProcessResult result = run(arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments;
    return result.err;
  };
  const std::string map = path("out/map.stillmap");
  EXPECT_THAT(refusal("check-path " + map), HasSubstr("--path"));
  EXPECT_THAT(refusal("check-path " + map + " --path 0 0"), HasSubstr("no heading"));
  EXPECT_THAT(refusal("check-path " + map + " --path 0 0 nan 1"), HasSubstr("nan"));
  EXPECT_THAT(refusal("check-path " + map + " --path 0 0 1"), HasSubstr("3 numbers"));
  EXPECT_THAT(refusal("check-path " + map + " --path 0 0 1 1 --headings 0"),
              HasSubstr("1 headings"));
  EXPECT_THAT(refusal("nearest " + map + " --to 1"), HasSubstr("--to"));
  EXPECT_THAT(refusal("nearest " + map + " --to nan 1"), HasSubstr("nan"));
  EXPECT_THAT(refusal("traversable " + map + " --sphere 9000 0 0 3"), HasSubstr("outside the map"));
  EXPECT_THAT(refusal("traversable " + map + " --corridor 0 0 9 9"), HasSubstr("--width"));
  EXPECT_THAT(refusal("traversable " + map + " --min-z 1"), HasSubstr("--min-z"));
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
