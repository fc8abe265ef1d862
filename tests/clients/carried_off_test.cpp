#include <filesystem>

#include "tests/clients/command_test.hpp"
#include "tests/clients/kitti_poses.hpp"

namespace stillmap::test {
namespace {

class CarriedOffTest : public CommandTest {};

// As where a recording was stopped, the robot carried, and the recording gone on with; what it is
// carried to was mapped before the run itself was stopped.
TEST_F(CarriedOffTest, IsFoundInTheMapThatItHasMade) {
  constexpr int carried_at = 230, carried_to = 10, scans = 310;
  const ProcessResult city =
      run("simulate " + path("city") + " --preset quiet --seed 1 --sensor vlp_16 --scans " +
          std::to_string(scans));
  ASSERT_EQ(city.exit_code, 0) << city.err;
  const auto copy = [&](const std::string& folder, const std::string& extension, int from, int to) {
    const auto file = [&](int k) {
      const std::string number = std::to_string(k);
      return folder_ / "city" / folder / (std::string(6 - number.size(), '0') + number + extension);
    };
    std::filesystem::copy_file(file(from), file(to),
                               std::filesystem::copy_options::overwrite_existing);
  };
  for (int k = carried_at; k < scans; ++k) {
    copy("velodyne", ".bin", k - carried_at + carried_to, k);
    copy("rings", ".bin", k - carried_at + carried_to, k);
  }
  std::filesystem::remove_all(folder_ / "city/labels");
  // A damaged file stops a run.
  const std::string map = "map " + path("city") + " --labels none --strict --json --out ";
  const std::filesystem::path damaged = folder_ / "city/velodyne/000200.bin";
  std::filesystem::copy_file(damaged, folder_ / "scan");
  std::filesystem::resize_file(damaged, 10);
  ASSERT_EQ(run(map + path("out") + " --save-period 0.2").exit_code, 2);
  std::filesystem::rename(folder_ / "scan", damaged);
  const ProcessResult result = run(map + path("out") + " --resume");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json report = nlohmann::json::parse(result.out);
  ASSERT_GT(report.at("resumed_at_scan"), 100) << "the way to where it is carried was mapped before";
  const nlohmann::json found = report.at("found_again_at_scans");
  ASSERT_EQ(found.size(), 1U);
  EXPECT_GT(found.at(0), carried_at + 30) << "the mapper has three seconds to find it by itself";
  EXPECT_LT(found.at(0), carried_at + 60);
  const auto poses = kitti_poses(content("out/poses_lidar.txt"));
  ASSERT_EQ(poses.size(), static_cast<std::size_t>(scans));
  const Eigen::Isometry3d off =
      poses.at(scans - carried_at + carried_to - 1).inverse() * poses.back();
  EXPECT_LT(off.translation().norm(), 0.1);
}

}  // namespace
}  // namespace stillmap::test
