#include <cmath>
#include <filesystem>
#include <sstream>
#include <vector>

#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

/// A map of six seconds of driving, to look for scans in.
class LocalizeCommandTest : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    simulate("city", 60);
    const ProcessResult mapped = run("map " + path("city") + " --out " + path("out"));
    ASSERT_EQ(mapped.exit_code, 0) << mapped.err;
  }
  [[nodiscard]] ProcessResult localize(const std::string& dataset,
                                       const std::string& more = "") const {
    return run("localize " + path("out/map.stillmap") + " " + path(dataset) + " " + more);
  }
  /// Where the mapper had the scan: x, y, z.
  [[nodiscard]] std::vector<double> mapped_position(std::size_t scan) const {
    std::istringstream lines(content("out/poses_lidar.txt"));
    std::string line;
    for (std::size_t k = 0; k <= scan; ++k) std::getline(lines, line);
    std::istringstream numbers(line);
    std::vector<double> row(12);
    for (double& number : row) numbers >> number;
    return {row[3], row[7], row[11]};
  }
};

TEST_F(LocalizeCommandTest, FindsScansWhereTheMapperHadThem) {
  const ProcessResult result = localize("city", "--start 5 --step 25 --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json report = nlohmann::json::parse(result.out);
  ASSERT_EQ(report.at("scans").size(), 3U);
  EXPECT_EQ(report.at("found"), 3);
  for (const nlohmann::json& scan : report.at("scans")) {
    SCOPED_TRACE(scan.dump());
    ASSERT_EQ(scan.at("status"), "found");
    const std::vector<double> expected = mapped_position(scan.at("scan"));
    const std::vector<double> found = scan.at("pose").at("position");
    EXPECT_LT(std::hypot(found[0] - expected[0], found[1] - expected[1], found[2] - expected[2]),
              0.2);
    EXPECT_GT(scan.at("score"), scan.at("runner_up_score"));
    EXPECT_EQ(scan.at("sweep_motion"), "no times");
    EXPECT_GT(scan.at("ms"), 0.0);
  }
}

TEST_F(LocalizeCommandTest, FindsNothingOfAnotherCity) {
  simulate("elsewhere", 30, " --seed 2");
  const ProcessResult other = localize("elsewhere", "--step 10 --json");
  ASSERT_EQ(other.exit_code, 0) << other.err;
  const nlohmann::json report = nlohmann::json::parse(other.out);
  EXPECT_EQ(report.at("found"), 0);
  EXPECT_EQ(report.at("scans").size(), 3U);
  for (const nlohmann::json& scan : report.at("scans")) EXPECT_TRUE(scan.at("pose").is_null());
}

TEST_F(LocalizeCommandTest, DrawsWhatItFinds) {
  const ProcessResult found =
      localize("city", "--start 30 --scans 1 --picture " + path("found.png"));
  ASSERT_EQ(found.exit_code, 0) << found.err;
  EXPECT_THAT(found.out, HasSubstr("1 of 1 scans found"));
  EXPECT_TRUE(exists("found.png"));
}

TEST_F(LocalizeCommandTest, NamesWhatItCannotUse) {
  const ProcessResult no_map = run("localize " + path("none.stillmap") + " " + path("city"));
  EXPECT_EQ(no_map.exit_code, 2);
  EXPECT_THAT(no_map.err, HasSubstr("none.stillmap"));
  write("text.stillmap", "no map at all");
  const ProcessResult no_map_file = run("localize " + path("text.stillmap") + " " + path("city"));
  EXPECT_EQ(no_map_file.exit_code, 2);
  EXPECT_THAT(no_map_file.err, HasSubstr("text.stillmap"));
  const ProcessResult no_scans = localize("nowhere");
  EXPECT_EQ(no_scans.exit_code, 2);
  EXPECT_THAT(no_scans.err, HasSubstr("nowhere"));
  const ProcessResult beyond = localize("city", "--start 1000");
  EXPECT_EQ(beyond.exit_code, 2);
  EXPECT_THAT(beyond.err, HasSubstr("; --start is 1000"));
  const ProcessResult picture = localize("city", "--scans 1 --picture " + path("found.jpg"));
  EXPECT_EQ(picture.exit_code, 2);
  EXPECT_EQ(picture.out, "");
  EXPECT_THAT(picture.err, HasSubstr(".png"));
}

TEST_F(LocalizeCommandTest, CountsScansThatItCannotRead) {
  for (const char* scan : {"000030", "000031"})
    std::filesystem::resize_file(path("city/velodyne/" + std::string(scan) + ".bin"), 10);
  const ProcessResult none = localize("city", "--start 30 --scans 2 --json");
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("no scan of"));
  const nlohmann::json report = nlohmann::json::parse(none.out);
  EXPECT_EQ(report.at("skipped"), 2);
  EXPECT_EQ(report.at("scans").size(), 0U);
  EXPECT_THAT(localize("city", "--start 29 --scans 3").out, HasSubstr("2 damaged ones skipped"));
}

}  // namespace
}  // namespace stillmap::test
