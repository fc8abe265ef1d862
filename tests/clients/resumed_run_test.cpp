#include <filesystem>

#include "tests/clients/command_test.hpp"

namespace stillmap::test {
namespace {

using ResumedRunTest = CommandTest;

// Its first scan has nothing before it that would tell how it moves.
TEST_F(ResumedRunTest, GoesOnWhereAFastLidarWasInItsTurn) {
  const ProcessResult simulated = run("simulate " + path("drive") +
                                      " --scans 42 --sensor vlp_16 --rolling --motion hard_turns");
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  const std::string map = "map " + path("drive") +
                          " --labels none --loops off --strict --save-period 0.0001 --json --out ";
  const ProcessResult whole = run(map + path("whole"));
  ASSERT_EQ(whole.exit_code, 0) << whole.err;
  // A damaged file stops a run.
  const std::filesystem::path scan = folder_ / "drive/velodyne/000030.bin";
  std::filesystem::copy_file(scan, folder_ / "scan");
  std::filesystem::resize_file(scan, 10);
  ASSERT_EQ(run(map + path("out")).exit_code, 2);
  std::filesystem::rename(folder_ / "scan", scan);
  const ProcessResult resumed = run(map + path("out") + " --resume");
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  const nlohmann::json report = nlohmann::json::parse(resumed.out);
  EXPECT_EQ(report.at("resumed_at_scan"), 30);
  EXPECT_FALSE(report.at("health").contains("lost")) << report.at("health");
  const double ate_m = report.at("accuracy").at("ate_rmse_m");
  EXPECT_LT(ate_m,
            nlohmann::json::parse(whole.out).at("accuracy").at("ate_rmse_m").get<double>() + 0.02);
}

// A map of a street, and poses that stay where it ended, would look like a result.
TEST_F(ResumedRunTest, FailsWhereNothingMoreFitsWhatItHadMapped) {
  simulate("drive", 24);
  const ProcessResult elsewhere =
      run("simulate " + path("elsewhere") + " --preset quiet --seed 9 --scans 24 --sensor vlp_16");
  ASSERT_EQ(elsewhere.exit_code, 0) << elsewhere.err;
  const std::string map = "map " + path("drive") + " --labels none --strict --out " + path("out");
  std::filesystem::resize_file(folder_ / "drive/velodyne/000012.bin", 10);
  ASSERT_EQ(run(map + " --save-period 0.0001").exit_code, 2);
  std::filesystem::remove_all(folder_ / "drive");
  std::filesystem::rename(folder_ / "elsewhere", folder_ / "drive");
  const ProcessResult resumed = run(map + " --resume");
  EXPECT_EQ(resumed.exit_code, 1);
  EXPECT_THAT(resumed.err, AllOf(HasSubstr("none of the 12 scans"), HasSubstr("--force")));
  EXPECT_FALSE(exists("out/map.stillmap"));
}

}  // namespace
}  // namespace stillmap::test
