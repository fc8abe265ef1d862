#include <cmath>
#include <numbers>
#include <set>
#include <tuple>
#include <vector>

#include "core/lidar/prepare.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/clients/command_test.hpp"
#include "tests/clients/kitti_poses.hpp"
#include "tests/clients/unusable_maps.hpp"

namespace stillmap::test {
namespace {

constexpr int scans = 110;

simulation::Simulation yard_of(int day) {
  simulation::SimulationConfig config;
  config.plan = simulation::test_yard();
  config.seed = 21;
  config.day = static_cast<std::uint64_t>(day);
  config.sensor = vlp_16();
  config.scans = scans;
  return simulation::Simulation(config);
}

class OntoCommandTest : public CommandTest {
 protected:
  void succeed(const std::string& arguments) const {
    const ProcessResult result = run(arguments);
    ASSERT_EQ(result.exit_code, 0) << arguments << "\n" << result.err;
  }
  /// Two days in a yard, the second put onto the map of the first, without labels: parked cars of
  /// the first are in its map.
  void map_two_days() {
    const std::string yard =
        " --preset yard --seed 21 --sensor vlp_16 --scans " + std::to_string(scans);
    for (const std::string day : {"1", "2"})
      succeed("simulate " + path("day" + day) + yard + " --day " + day);
    succeed("map " + path("day1") + " --labels none --out " + path("one"));
    // As where a receiver said where it lies.
    SavedMap placed = open_map_file(folder_ / "one/map.stillmap")->load();
    placed.metadata["datum"] = datum_;
    open_map_file(folder_ / "one/map.stillmap")->save(placed);
    first_bytes_ = content("one/map.stillmap");
    succeed("map " + path("day2") + " --labels none --onto " + path("one/map.stillmap") +
            " --out " + path("both"));
  }
  [[nodiscard]] nlohmann::json report_of(const std::string& folder) const {
    return nlohmann::json::parse(content(folder + "/report.json"));
  }
  void expect_true_poses() const;
  void expect_a_report() const;
  void expect_that_cars_went_and_came() const;
  void expect_that_the_session_can_be_withdrawn() const;

  std::string first_bytes_;
  const std::string datum_ = "48.1,11.5,500,90";
};

// One test: every one is run by itself, and would map the days again.
TEST_F(OntoCommandTest, PutsADriveOntoTheMapOfAnotherDay) {
  ASSERT_NO_FATAL_FAILURE(map_two_days());
  EXPECT_EQ(content("one/map.stillmap"), first_bytes_);
  EXPECT_EQ(open_map_file(folder_ / "both/map.stillmap")->load().metadata.at("datum"), datum_);
  expect_true_poses();
  expect_a_report();
  expect_that_cars_went_and_came();
  expect_that_the_session_can_be_withdrawn();
}

void OntoCommandTest::expect_true_poses() const {
  const simulation::Simulation one = yard_of(1), two = yard_of(2);
  const Eigen::Isometry3d T_map_city = one.T_map_lidar_at(0.0).inverse();
  const auto poses = kitti_poses(content("both/poses_lidar.txt"));
  ASSERT_EQ(poses.size(), static_cast<std::size_t>(scans));
  for (int k = 0; k < scans; ++k) {
    const Eigen::Isometry3d truth =
        T_map_city * two.T_map_lidar_at(k * two.config().sensor.period_s);
    const Eigen::Isometry3d off = truth.inverse() * poses[static_cast<std::size_t>(k)];
    EXPECT_LT(off.translation().norm(), 0.1) << k;
    EXPECT_LT(Eigen::AngleAxisd(off.linear()).angle(), 0.3 * std::numbers::pi / 180.0) << k;
  }
}

void OntoCommandTest::expect_a_report() const {
  const nlohmann::json onto = report_of("both").at("onto");
  EXPECT_GE(onto.at("found"), 2);
  EXPECT_GE(onto.at("closures").size(), 2U);
  for (const nlohmann::json& closure : onto.at("closures")) {
    EXPECT_EQ(closure.at("T_map_lidar").size(), 12U);
    EXPECT_TRUE(closure.at("refusal").is_null());
    EXPECT_LT(closure.at("scan"), scans);
  }
  EXPECT_GT(onto.at("clock_offset_ns"), 0) << "both clocks begin at 0";
  EXPECT_TRUE(report_of("one").at("onto").is_null());
}

/// Where a point of the map frame is, in cells of 0.4 m.
using Cell = std::tuple<int, int, int>;
Cell cell_of(const Eigen::Vector3d& p) {
  const auto index = [](double v) { return static_cast<int>(std::floor(v / 0.4)); };
  return {index(p.x()), index(p.y()), index(p.z())};
}

/// Cells of what stands a day: `cars` are parked ones above the ground, as the truth has them.
struct Day {
  std::set<Cell> cars;
  std::set<Cell> all;
};
Day day_of(int number, const Eigen::Isometry3d& T_map_city) {
  const simulation::Simulation day = yard_of(number);
  Day cells;
  for (int k = 0; k < scans; k += 5) {
    const simulation::SimulatedScan scan = day.scan(k);
    const Eigen::Isometry3d T = T_map_city * scan.T_map_lidar;
    for (std::size_t i = 0; i < scan.scan.size(); ++i) {
      const Eigen::Vector3d p = T * scan.scan.points_lidar[i].cast<double>();
      if (scan.scan.points_lidar[i].norm() > 20.0F) continue;
      const bool is_parked = (scan.raw_labels[i] & 0xFFFFU) == 10;
      if (is_parked && p.z() > -1.2) cells.cars.insert(cell_of(p));
      for (int near = 0; near < 27; ++near) {
        cells.all.insert(
            cell_of(p + 0.3 * Eigen::Vector3d(near % 3 - 1, near / 3 % 3 - 1, near / 9 - 1)));
      }
    }
  }
  return cells;
}

std::set<Cell> cells_of(const std::filesystem::path& file) {
  std::set<Cell> cells;
  const SavedMap map = read_map_file(file);
  for (const auto& tile : map.view.tiles)
    for (const Voxel& voxel : tile->voxels) cells.insert(cell_of(voxel.mean_map.cast<double>()));
  return cells;
}

void OntoCommandTest::expect_that_cars_went_and_came() const {
  const Eigen::Isometry3d T_map_city = yard_of(1).T_map_lidar_at(0.0).inverse();
  const Day one = day_of(1, T_map_city), two = day_of(2, T_map_city);
  const auto before = cells_of(folder_ / "one/map.stillmap");
  const auto after = cells_of(folder_ / "both/map.stillmap");
  int gone = 0, gone_still_there = 0, came = 0, came_there = 0;
  for (const Cell& cell : one.cars) {
    if (two.all.contains(cell) || !before.contains(cell)) continue;
    ++gone;
    gone_still_there += after.contains(cell) ? 1 : 0;
  }
  for (const Cell& cell : two.cars) {
    if (one.all.contains(cell) || before.contains(cell)) continue;
    ++came;
    came_there += after.contains(cell) ? 1 : 0;
  }
  ASSERT_GT(gone, 100);
  ASSERT_GT(came, 100);
  EXPECT_LT(gone_still_there, gone / 4);
  EXPECT_GT(came_there, came / 2);
}

void OntoCommandTest::expect_that_the_session_can_be_withdrawn() const {
  const ProcessResult listed = run("sessions " + path("both/map.stillmap") + " --json");
  ASSERT_EQ(listed.exit_code, 0) << listed.err;
  const nlohmann::json sessions = nlohmann::json::parse(listed.out);
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_EQ(sessions[0].at("source"), path("day1"));
  EXPECT_EQ(sessions[1].at("source"), path("day2"));
  EXPECT_EQ(sessions[1].at("poses"), scans);
  EXPECT_GE(sessions[1].at("closures"), 2);
  EXPECT_EQ(run("map-check " + path("both/map.stillmap")).exit_code, 0);

  const ProcessResult withdrawn =
      run("sessions " + path("both/map.stillmap") + " --withdraw 2 --out " + path("one.stillmap"));
  ASSERT_EQ(withdrawn.exit_code, 0) << withdrawn.err;
  EXPECT_THAT(
      run("map-diff --tolerance 0 " + path("one/map.stillmap") + " " + path("one.stillmap")).out,
      HasSubstr("nothing changed"));
  for (const auto& [arguments, fault] :
       {std::pair<std::string, std::string>{"--withdraw 2", "--out"},
        {"--withdraw 1 --out " + path("x.stillmap"), "only the newest"},
        {"--withdraw 2 --out " + path("one.stillmap"), "exists already"},
        {"--withdraw 2 --out " + path("both/map.stillmap") + " --force", "the map itself"}}) {
    const ProcessResult refused = run("sessions " + path("both/map.stillmap") + " " + arguments);
    EXPECT_EQ(refused.exit_code, 2) << arguments;
    EXPECT_THAT(refused.err, HasSubstr(fault)) << arguments;
  }
}

TEST_F(OntoCommandTest, AnotherYardIsNotRecognised) {
  simulate("yard", 40, " --seed 21");
  simulate("elsewhere", 60, " --seed 2");
  ASSERT_NO_FATAL_FAILURE(succeed("map " + path("yard") + " --out " + path("one")));
  const ProcessResult refused = run("map " + path("elsewhere") + " --onto " +
                                    path("one/map.stillmap") + " --out " + path("out"));
  EXPECT_EQ(refused.exit_code, 5);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("not recognised"), HasSubstr("were looked for"),
                                 HasSubstr("without --onto")));
  EXPECT_FALSE(exists("out/map.stillmap"));
  EXPECT_FALSE(exists("out/unfinished"));
}

TEST_F(OntoCommandTest, NamesWhatCannotBeGoneOnIn) {
  simulate("yard", 6);
  ASSERT_NO_FATAL_FAILURE(succeed("map " + path("yard") + " --out " + path("one")));
  write_unusable_maps(folder_);
  const std::string one = path("one/map.stillmap");
  for (const auto& [options, fault] :
       {std::pair<std::string, std::string>{path("none.stillmap"), "none.stillmap"},
        {path("text.stillmap"), "text.stillmap"},
        {path("empty.stillmap"), "is an empty map"},
        {path("coarse.stillmap"), "the stored map has voxel_size_m 0.4"},
        {one + " --loops off", "--loops on"},
        {one + " --force --out " + path("one"), "name another --out"}}) {
    const ProcessResult refused =
        run("map " + path("yard") + " --onto " + options +
            (options.find("--out") == std::string::npos ? " --out " + path("out") : std::string()));
    EXPECT_EQ(refused.exit_code, 2) << options;
    EXPECT_THAT(refused.err, HasSubstr(fault)) << options;
    EXPECT_FALSE(exists("out")) << options;
  }
}

}  // namespace
}  // namespace stillmap::test
