#include "core/simulation/training_city.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace stillmap::simulation {
namespace {

constexpr std::uint64_t first_seed = 4000;

// Fewer firings, to be quick.
SimulationConfig quick_sequence(std::uint64_t seed) {
  SimulationConfig config = training_sequence(seed);
  config.firings = 500;
  return config;
}

TEST(TrainingPlan, IsWithoutFaultWhateverIsDrawn) {
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    ASSERT_EQ(training_sequence(seed).faults(), "") << seed;
  }
}

TEST(TrainingPlan, VariesEverything) {
  std::set<int> lanes;
  std::map<std::string, int> sensors;
  int without_sidewalk = 0, without_kerb = 0, sloped = 0, with_car_park = 0, without_houses = 0;
  int at_sidewalk = 0, paved_yards = 0, parked_on_road = 0, without_lines = 0, quiet_lidars = 0;
  constexpr int sequences = 600;
  for (std::uint64_t seed = 0; seed < sequences; ++seed) {
    const SimulationConfig sequence = training_sequence(seed);
    lanes.insert(sequence.plan.route_profile.lanes);
    ++sensors[sequence.sensor.name];
    without_sidewalk += sequence.plan.route_profile.sidewalk_m == 0.0 ? 1 : 0;
    without_kerb += sequence.plan.kerb_m == 0.0 ? 1 : 0;
    sloped += sequence.plan.embankment_m > 1.0 ? 1 : 0;
    with_car_park += sequence.plan.patches.empty() ? 0 : 1;
    const BlockPlan& blocks = sequence.plan.blocks;
    without_houses += blocks.share_open + blocks.share_wood > 0.6 ? 1 : 0;
    at_sidewalk += blocks.setback_max_m < 0.4 ? 1 : 0;
    paved_yards += sequence.plan.share_paved_yards > 0.3 ? 1 : 0;
    const StreetProfile& profile = sequence.plan.route_profile;
    parked_on_road += profile.parking_m > 0.0 && !profile.has_bays ? 1 : 0;
    without_lines += !sequence.plan.lane_lines && !sequence.plan.edge_lines ? 1 : 0;
    quiet_lidars += sequence.noise.range_sigma_m < 0.01 ? 1 : 0;
    EXPECT_LE(blocks.share_fence + blocks.share_hedge + blocks.share_wall + blocks.share_thicket,
              1.0);
    EXPECT_LE(blocks.share_open + blocks.share_wood + blocks.share_halls, 1.0 + 1e-9);
  }
  EXPECT_EQ(lanes, (std::set{1, 2, 3}));
  EXPECT_NEAR(sensors["HDL-64E"], 0.6 * sequences, 0.08 * sequences);
  EXPECT_NEAR(sensors["VLP-16"], 0.2 * sequences, 0.06 * sequences);
  EXPECT_NEAR(sensors["HDL-32E"], 0.1 * sequences, 0.05 * sequences);
  EXPECT_EQ(sensors.size(), 4U);
  for (const int count : {without_sidewalk, without_kerb, sloped, with_car_park, without_houses,
                          at_sidewalk, paved_yards, parked_on_road, without_lines, quiet_lidars}) {
    EXPECT_GT(count, sequences / 20);
    EXPECT_LT(count, sequences);
  }
}

TEST(TrainingSequence, SameSeedGivesTheSameBits) {
  const SimulatedScan a = Simulation(quick_sequence(first_seed)).scan(40);
  const SimulatedScan b = Simulation(quick_sequence(first_seed)).scan(40);
  EXPECT_EQ(a.scan.points_lidar, b.scan.points_lidar);
  EXPECT_EQ(a.scan.intensity, b.scan.intensity);
  EXPECT_EQ(a.raw_labels, b.raw_labels);
  EXPECT_NE(a.scan.points_lidar,
            Simulation(quick_sequence(first_seed + 1)).scan(40).scan.points_lidar);
}

TEST(TrainingSequence, ScansAreFarApartAndAsManyAsWanted) {
  for (std::uint64_t seed = first_seed; seed < first_seed + 4; ++seed) {
    const Simulation sequence(quick_sequence(seed));
    const std::vector<int> scans = spread_scans(sequence, 8);
    ASSERT_EQ(scans.size(), 8U) << seed;
    for (std::size_t i = 1; i < scans.size(); ++i) {
      const double period_s = sequence.config().sensor.period_s;
      const Eigen::Vector3d step = sequence.T_map_lidar_at(scans[i] * period_s).translation() -
                                   sequence.T_map_lidar_at(scans[i - 1] * period_s).translation();
      // 8 m along the route, less in a straight line where it turns.
      EXPECT_GT(step.norm(), 4.0) << seed;
    }
  }
}

/// Turns of 3.75 degrees at a time would turn a low lidar's poses by a degree.
TEST(AnySequence, TurnsAsAVehicleDoes) {
  const Simulation sequence(any_sequence(608, hdl_64e()));
  const auto turn_rad = [&](int k) {
    const Eigen::Isometry3d T =
        sequence.T_map_lidar_at(0.1 * (k - 1)).inverse() * sequence.T_map_lidar_at(0.1 * k);
    return Eigen::AngleAxisd(T.linear()).angle();
  };
  double most_rad = 0.0, most_change_rad = 0.0;
  for (int k = 2; k < 200; ++k) {
    most_rad = std::max(most_rad, turn_rad(k));
    most_change_rad = std::max(most_change_rad, std::abs(turn_rad(k) - turn_rad(k - 1)));
  }
  EXPECT_GT(most_rad, 0.02);
  EXPECT_LT(most_change_rad, 0.035);
}

TEST(AnySequence, IsThatOfTheSeedWhateverTheLidar) {
  const SimulationConfig of_64 = any_sequence(608, hdl_64e());
  const SimulationConfig of_16 = any_sequence(608, vlp_16());
  EXPECT_EQ(of_64.faults(), "");
  EXPECT_EQ(of_16.faults(), "");
  EXPECT_EQ(of_16.sensor.rings, 16);
  EXPECT_EQ(of_16.flaws.beams.size(), 16U);
  EXPECT_EQ(of_64.lidar_height_m, of_16.lidar_height_m);
  EXPECT_EQ(of_64.plan.route, of_16.plan.route);
  EXPECT_NE(of_64.plan.route, any_sequence(609, hdl_64e()).plan.route);
}

/// Some scans of several cities.
class TrainingScans : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scans_ = new std::vector<SimulatedScan>;
    heights_m_ = new std::vector<double>;
    for (std::uint64_t seed = first_seed; seed < first_seed + cities; ++seed) {
      const Simulation sequence(quick_sequence(seed));
      for (const int index : spread_scans(sequence, 4)) {
        scans_->push_back(sequence.scan(index));
        heights_m_->push_back(sequence.config().lidar_height_m);
      }
    }
  }
  static void TearDownTestSuite() {
    delete scans_;
    delete heights_m_;
  }

  static constexpr std::uint64_t cities = 16;
  static std::vector<SimulatedScan>* scans_;
  static std::vector<double>* heights_m_;
};
std::vector<SimulatedScan>* TrainingScans::scans_ = nullptr;
std::vector<double>* TrainingScans::heights_m_ = nullptr;

TEST_F(TrainingScans, ShowEveryClass) {
  std::map<SemanticClass, int> seen;
  for (const SimulatedScan& scan : *scans_) {
    for (const SemanticClass label : scan.scan.labels) ++seen[label];
  }
  for (std::size_t label = 0; label < semantic_class_count; ++label) {
    const auto one = static_cast<SemanticClass>(label);
    EXPECT_GT(seen[one], 200) << name(one);
  }
}

TEST_F(TrainingScans, AreSaneInEveryPoint) {
  for (const SimulatedScan& scan : *scans_) {
    ASSERT_GT(scan.scan.size(), 1500U);
    for (std::size_t i = 0; i < scan.scan.size(); ++i) {
      ASSERT_TRUE(scan.scan.points_lidar[i].allFinite());
      ASSERT_GE(scan.scan.intensity[i], 0.0F);
      ASSERT_LE(scan.scan.intensity[i], 1.0F);
      ASSERT_EQ(scan.raw_labels[i] >> 16U != 0, is_movable(scan.scan.labels[i]));
    }
  }
}

// Lowest and highest of the points within 12 m, over the ground under the lidar.
std::pair<float, float> heights_of(const SimulatedScan& scan, double lidar_height_m,
                                   SemanticClass label) {
  std::pair<float, float> out{0.0F, 0.0F};
  for (std::size_t i = 0; i < scan.scan.size(); ++i) {
    if (scan.scan.labels[i] != label || scan.scan.points_lidar[i].norm() > 12.0F) continue;
    const Eigen::Vector3d up = scan.T_map_lidar.linear() * scan.scan.points_lidar[i].cast<double>();
    const auto height = static_cast<float>(up.z() + lidar_height_m);
    out = {std::min(out.first, height), std::max(out.second, height)};
  }
  return out;
}

TEST_F(TrainingScans, RoadsLieBelowAndPeopleAreAsTallAsPeople) {
  int roads = 0;
  int people = 0;
  for (std::size_t i = 0; i < scans_->size(); ++i) {
    const SimulatedScan& scan = (*scans_)[i];
    const double height_m = (*heights_m_)[i];
    const auto road = heights_of(scan, height_m, SemanticClass::road);
    EXPECT_GT(road.first, -1.6F);
    EXPECT_LT(road.second, 1.6F);
    const auto person = heights_of(scan, height_m, SemanticClass::person);
    EXPECT_LT(person.second, 4.0F);
    roads += road.first < road.second ? 1 : 0;
    people += person.first < person.second ? 1 : 0;
  }
  EXPECT_GT(roads, 0);
  EXPECT_GT(people, 0);
}

}  // namespace
}  // namespace stillmap::simulation
