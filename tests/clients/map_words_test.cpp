#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

using testing::Not;

/// What 'stillmap map' says of what it took, and of what it refuses.
class MapWordsTest : public CommandTest {
 protected:
  [[nodiscard]] ProcessResult map_city(const std::string& options) const {
    return run("map " + path("city") + " --force --out " + path("out") + " " + options);
  }
  [[nodiscard]] nlohmann::json sensor() const {
    return nlohmann::json::parse(content("out/report.json")).at("sensor");
  }
};

TEST_F(MapWordsTest, NamesTheLidarAndWhatToldIt) {
  simulate("city", 3);
  for (const char* options : {"", "--sensor auto"}) {
    const ProcessResult told = map_city(options);
    ASSERT_EQ(told.exit_code, 0) << told.err;
    EXPECT_THAT(told.out, AllOf(HasSubstr("lidar: VLP-16, as the scans tell"),
                                HasSubstr("labels: the recording's own")));
    EXPECT_EQ(sensor().at("told_by"), "scans");
  }
  EXPECT_THAT(map_city("--sensor vlp_16").out, HasSubstr("lidar: VLP-16, as --sensor names it"));
  write("server.yaml", "sensor: vlp_16\n");
  const std::string config = "--config " + path("server.yaml");
  EXPECT_THAT(map_city(config).out, HasSubstr("lidar: VLP-16, as --config names it"));
  EXPECT_EQ(sensor().at("told_by"), "configuration");
  EXPECT_THAT(map_city(config + " --sensor auto").out, HasSubstr("as the scans tell"));
}

TEST_F(MapWordsTest, AnUnknownSensorHasAWayOut) {
  simulate("city", 3);
  const ProcessResult refused = map_city("--sensor os1_64");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("os1_64"), HasSubstr("vlp_16"),
                                 HasSubstr("Without a name the scans tell the lidar"),
                                 HasSubstr("stillmap dataset sensor")));
}

TEST_F(MapWordsTest, WithoutLabelsMovingPointsAreNotLookedFor) {
  simulate("city", 3);
  const ProcessResult result = map_city("--labels none");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, AllOf(HasSubstr("moving points: not looked for"),
                                Not(HasSubstr("moving points found"))));
  const auto report = nlohmann::json::parse(content("out/report.json"));
  EXPECT_TRUE(report.at("moving_points").at("recall").is_null());
}

TEST_F(MapWordsTest, ScansThatAreNotThereAreNamedByTheirNumbers) {
  simulate("city", 3);
  EXPECT_THAT(map_city("--start 500").err, HasSubstr("has 3 scans, 0 to 2; --start is 500"));
  EXPECT_THAT(map_city("--scans 0").err, HasSubstr("--scans 0"));
}

TEST_F(MapWordsTest, ARunThatIsNotResumedNamesWhatDiffers) {
  simulate("city", 14);
  std::filesystem::resize_file(folder_ / "city/labels/000012.label", 10);
  const std::string city = "map " + path("city") + " --out " + path("out");
  ASSERT_EQ(run(city + " --strict --save-period 0.0001").exit_code, 2);
  const ProcessResult other = run(city + " --resume --loops off");
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, AllOf(HasSubstr("with loops closed"), Not(HasSubstr("sensor"))));
}

}  // namespace
}  // namespace stillmap::test
