#include <filesystem>

#include "config/loaders/sensor_file.hpp"
#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

constexpr const char* two_cities = " --cities 2 --scans-per-city 2 --first-seed 1018";

class SimulateTrainingCommandTest : public CommandTest {
 protected:
  ProcessResult train(const std::string& folder, const std::string& options = two_cities) {
    return run("simulate-training " + path(folder) + options);
  }
};

TEST_F(SimulateTrainingCommandTest, WritesSequencesThatNameTheirSensor) {
  const ProcessResult result = train("set");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("2 cities (0 were there), 4 new scans"));
  for (const std::string seed : {"1018", "1019"}) {
    const std::string sequence = "set/sequences/" + seed;
    for (const char* file : {"/velodyne/000001.bin", "/labels/000001.label", "/poses.txt",
                             "/times.txt", "/calib.txt", "/sensor.yaml"}) {
      EXPECT_TRUE(exists(sequence + file)) << file;
    }
    EXPECT_FALSE(exists(sequence + "/velodyne/000002.bin"));
    EXPECT_EQ(load_sensor(path(sequence + "/sensor.yaml")).faults(), "");
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(path("set/sequences")), {}), 2);
}

TEST_F(SimulateTrainingCommandTest, IsTheSameOnAnyNumberOfThreads) {
  ASSERT_EQ(train("a", two_cities + std::string(" --jobs 1")).exit_code, 0);
  ASSERT_EQ(train("b", two_cities + std::string(" --jobs 3")).exit_code, 0);
  const std::string scan = "/sequences/1019/velodyne/000001.bin";
  EXPECT_EQ(content("a" + scan), content("b" + scan));
  EXPECT_NE(content("a" + scan), content("a/sequences/1018/velodyne/000001.bin"));
}

TEST_F(SimulateTrainingCommandTest, GoesOnWhereItWasStopped) {
  ASSERT_EQ(train("set").exit_code, 0);
  const std::string kept = "set/sequences/1018/poses.txt";
  const auto written = std::filesystem::last_write_time(path(kept));
  const std::string scan = "set/sequences/1019/velodyne/000000.bin";
  const std::string first = content(scan);
  // As a stop in the middle of the second city leaves it.
  std::filesystem::rename(path("set/sequences/1019"), path("set/sequences/1019.unfinished"));
  const ProcessResult again = train("set", two_cities + std::string(" --json"));
  ASSERT_EQ(again.exit_code, 0) << again.err;
  const nlohmann::json json = nlohmann::json::parse(again.out);
  EXPECT_EQ(json.at("cities"), 2);
  EXPECT_EQ(json.at("skipped"), 1);
  EXPECT_EQ(json.at("scans"), 2);
  EXPECT_EQ(std::filesystem::last_write_time(path(kept)), written);
  EXPECT_EQ(content(scan), first);
  EXPECT_FALSE(exists("set/sequences/1019.unfinished"));
}

TEST_F(SimulateTrainingCommandTest, RefusesWhatMakesNoSense) {
  EXPECT_EQ(run("simulate-training").exit_code, 2);
  for (const char* option : {" --cities 0", " --cities -3", " --scans-per-city 0", " --jobs 0",
                             " --first-seed -1", " --cities many"}) {
    EXPECT_EQ(train("set", option).exit_code, 2) << option;
  }
  EXPECT_FALSE(exists("set"));
}

TEST_F(SimulateTrainingCommandTest, NamesTheFolderThatCannotBeMade) {
  const ProcessResult result = run("simulate-training /dev/null/set --cities 1");
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("/dev/null/set"));
}

}  // namespace
}  // namespace stillmap::test
