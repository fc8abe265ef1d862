#include <algorithm>
#include <csignal>
#include <cstring>
#include <vector>

#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

class SimulateCommandTest : public CommandTest {};

TEST_F(SimulateCommandTest, WritesASequenceWithTruth) {
  simulate("city", 3);
  for (const char* file : {"city/velodyne/000002.bin", "city/labels/000002.label", "city/times.txt",
                           "city/calib.txt", "city/poses.txt", "city/first_pose_city.txt"}) {
    EXPECT_TRUE(exists(file)) << file;
  }
  EXPECT_FALSE(exists("city/velodyne/000003.bin"));
  EXPECT_EQ(line_count("city/poses.txt"), 3U);
}

TEST_F(SimulateCommandTest, SaysThatItWasStoppedAndKeepsWhatThereIs) {
  BackgroundProcess simulation(
      stillmap_program() + " simulate " + path("city") + " --preset yard --scans 100000",
      folder_ / "log");
  ASSERT_TRUE(eventually([&] { return exists("city/velodyne/000002.bin"); }));
  simulation.send(SIGINT);
  EXPECT_EQ(simulation.wait(), 1);
  EXPECT_THAT(content("log"),
              AllOf(HasSubstr("stopped early, as asked, after "), HasSubstr(" of 100000 scans")));
  EXPECT_GE(line_count("city/poses.txt"), 2U);
}

TEST_F(SimulateCommandTest, NamesTheOptionThatCannotBe) {
  const ProcessResult low = run("simulate " + path("city") + " --mount 1.2,0,0,0,5,0");
  EXPECT_EQ(low.exit_code, 2);
  EXPECT_EQ(low.err,
            "stillmap: --mount: z, the lidar's height above the ground [m], is 0, must be 0.3 to "
            "4\n");
  EXPECT_THAT(run("simulate " + path("city") + " --scans 100001").err,
              HasSubstr("--scans is 100001, must be 1 to 100000"));
}

TEST_F(SimulateCommandTest, WritesTheSamplesOfAnImuWhenAsked) {
  simulate("plain", 1);
  EXPECT_FALSE(exists("plain/imu.csv"));
  simulate("city", 3, " --imu");
  // A line of names, then 200 a second.
  EXPECT_EQ(line_count("city/imu.csv"), 1U + 61U);
  const ProcessResult drives =
      run("evaluate drives " + path("city") + " --imu deg_per_s --scans 2");
  EXPECT_EQ(drives.exit_code, 0) << drives.err;
}

TEST_F(SimulateCommandTest, IsTheSameForTheSameSeedOnly) {
  const std::string common = " --preset yard --sensor vlp16 --scans 1 --seed ";
  ASSERT_EQ(run("simulate " + path("a") + common + "1").exit_code, 0);
  ASSERT_EQ(run("simulate " + path("b") + common + "1").exit_code, 0);
  ASSERT_EQ(run("simulate " + path("c") + common + "2").exit_code, 0);
  EXPECT_EQ(content("a/velodyne/000000.bin"), content("b/velodyne/000000.bin"));
  EXPECT_NE(content("a/velodyne/000000.bin"), content("c/velodyne/000000.bin"));
}

TEST_F(SimulateCommandTest, DrawsAnyCityAndTheFlawsOfItsLidar) {
  const std::string any = " --preset any --seed 608 --scans 1 --sensor ";
  ASSERT_EQ(run("simulate " + path("vlp") + any + "vlp16").exit_code, 0);
  EXPECT_THAT(run("evaluate drives sim:any,seed=608,sensor=vlp_16,scans=3,traffic=0").out,
              HasSubstr("sim:any,seed=608"));
}

TEST_F(SimulateCommandTest, NothingMovesWithoutTraffic) {
  ASSERT_EQ(run("simulate " + path("empty") +
                " --preset crowd --traffic 0 --sensor vlp_16 --scans 1 --seed 1")
                .exit_code,
            0);
  const std::string bytes = content("empty/labels/000000.label");
  std::vector<std::uint32_t> labels(bytes.size() / sizeof(std::uint32_t));
  std::memcpy(labels.data(), bytes.data(), labels.size() * sizeof(std::uint32_t));
  ASSERT_GT(labels.size(), 10'000U);
  constexpr std::uint32_t first_moving_id = 252;
  EXPECT_EQ(std::ranges::count_if(
                labels, [](std::uint32_t label) { return (label & 0xFFFFU) >= first_moving_id; }),
            0);
}

TEST_F(SimulateCommandTest, PrintsJsonWhenAsked) {
  const ProcessResult result = run("simulate " + path("city") +
                                   " --preset yard --sensor vlp16 --scans 1 --traffic 0 --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json json = nlohmann::json::parse(result.out);
  EXPECT_EQ(json.at("scans"), 1);
  EXPECT_GT(json.at("points"), 1000);
}

TEST_F(SimulateCommandTest, DoesNotWriteOverARecording) {
  simulate("city", 1);
  const ProcessResult again = run("simulate " + path("city") + " --preset yard --scans 1");
  EXPECT_EQ(again.exit_code, 2);
  EXPECT_THAT(again.err, HasSubstr(path("city")));
}

TEST_F(SimulateCommandTest, RefusesWhatItDoesNotKnow) {
  const std::string out = "simulate " + path("city");
  EXPECT_EQ(run(out + " --scans 0").exit_code, 2);
  EXPECT_EQ(run(out + " --scans -5").exit_code, 2);
  EXPECT_THAT(run(out + " --seed -1").err, HasSubstr("--seed"));
  for (const std::string traffic : {"-1", "nan", "11", "crowd"}) {
    const ProcessResult result = run(out + " --traffic " + traffic);
    EXPECT_EQ(result.exit_code, 2) << traffic;
    EXPECT_THAT(result.err, HasSubstr("--traffic")) << traffic;
  }
  const ProcessResult preset = run(out + " --preset moon");
  EXPECT_EQ(preset.exit_code, 2);
  EXPECT_THAT(preset.err, HasSubstr("moon"));
  EXPECT_THAT(preset.err, HasSubstr("'any'"));
  const ProcessResult sensor = run(out + " --sensor hdl_65");
  EXPECT_EQ(sensor.exit_code, 2);
  EXPECT_THAT(sensor.err, HasSubstr("hdl_65"));
  for (const std::string delay : {"nan", "inf", "-1e300", "1e10"}) {
    const ProcessResult late = run(out + " --gnss 1 --gnss-delay " + delay);
    EXPECT_EQ(late.exit_code, 2) << delay;
    EXPECT_THAT(late.err, HasSubstr("--gnss-delay")) << delay;
  }
  EXPECT_FALSE(exists("city"));
}

}  // namespace
}  // namespace stillmap::test
