// Properties of the simulated scans of the presets.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <unordered_set>

#include "core/simulation/simulation.hpp"

namespace stillmap::simulation {
namespace {

SimulationConfig with_plan(CityPlan plan, int scans) {
  SimulationConfig config;
  config.plan = std::move(plan);
  config.scans = scans;
  config.firings = 1000;
  return config;
}

bool moves(std::uint32_t raw_label) {
  return is_moving_semantic_kitti(static_cast<std::uint16_t>(raw_label & 0xFFFFU));
}

double moving_share(const SimulatedScan& out) {
  const auto moving = std::ranges::count_if(out.raw_labels, moves);
  return static_cast<double>(moving) / static_cast<double>(out.raw_labels.size());
}

// Occupied cells of a grid.
class Voxels {
 public:
  explicit Voxels(double size_m) : size_m_(size_m) {}
  void add(const Eigen::Vector3d& p) { keys_.insert(key(p, 0, 0, 0)); }
  // Also true for the neighbours of a filled cell.
  [[nodiscard]] bool near(const Eigen::Vector3d& p) const {
    for (int i = 0; i < 27; ++i) {
      if (keys_.contains(key(p, i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1))) return true;
    }
    return false;
  }

 private:
  [[nodiscard]] std::int64_t key(const Eigen::Vector3d& p, int dx, int dy, int dz) const {
    const auto cell = [&](double x, int d) {
      return static_cast<std::int64_t>(std::floor(x / size_m_)) + d + (1 << 19);
    };
    return (cell(p.x(), dx) << 40) | (cell(p.y(), dy) << 20) | cell(p.z(), dz);
  }
  double size_m_;
  std::unordered_set<std::int64_t> keys_;
};

// Share of the points near the sensor, chosen by `wanted`, that land on points of `earlier`.
template <class Predicate>
double share_found_again(const SimulatedScan& earlier, const SimulatedScan& later,
                         Predicate wanted) {
  Voxels voxels(0.3);
  for (std::size_t i = 0; i < earlier.scan.size(); ++i) {
    if (!wanted(earlier.raw_labels[i])) continue;
    voxels.add(earlier.T_map_lidar * earlier.scan.points_lidar[i].cast<double>());
  }
  int found = 0;
  int all = 0;
  for (std::size_t i = 0; i < later.scan.size(); ++i) {
    if (!wanted(later.raw_labels[i]) || later.scan.points_lidar[i].norm() > 15.0F) continue;
    ++all;
    found += voxels.near(later.T_map_lidar * later.scan.points_lidar[i].cast<double>()) ? 1 : 0;
  }
  return all == 0 ? 0.0 : static_cast<double>(found) / all;
}

class Avenue : public testing::Test {
 protected:
  static void SetUpTestSuite() { avenue_ = new Simulation(with_plan(crowded_avenue(), 100)); }
  static void TearDownTestSuite() {
    delete avenue_;
    avenue_ = nullptr;
  }
  static const Simulation* avenue_;
};
const Simulation* Avenue::avenue_ = nullptr;

TEST_F(Avenue, TruePosesDoNotLayMovingPointsOnEachOther) {
  // The sides of a moving car overlap themselves; its ends do not.
  EXPECT_LT(share_found_again(avenue_->scan(0), avenue_->scan(4), moves), 0.8);
}

TEST(QuietCity, TruePosesLayStaticPointsOnEachOther) {
  const Simulation quiet(with_plan(quiet_city(), 10));
  const auto is_wall = [](std::uint32_t raw) { return (raw & 0xFFFFU) == 50; };
  EXPECT_GT(share_found_again(quiet.scan(0), quiet.scan(4), is_wall), 0.9);
}

TEST_F(Avenue, IsCrowdedWithMovingVehicles) {
  double share = 0.0;
  for (int i = 0; i < 100; i += 10) share += moving_share(avenue_->scan(i)) / 10.0;
  EXPECT_GT(share, 0.25);
}

TEST_F(Avenue, HasVehiclesAlongsideAtTheEgosOwnSpeed) {
  std::map<std::uint32_t, std::pair<double, int>> first, last;
  const auto centres = [](const SimulatedScan& out, auto& into) {
    for (std::size_t i = 0; i < out.scan.size(); ++i) {
      if (!moves(out.raw_labels[i]) || out.scan.points_lidar[i].norm() > 15.0F) continue;
      auto& [sum, count] = into[out.raw_labels[i] >> 16U];
      sum += out.scan.points_lidar[i].x();
      ++count;
    }
  };
  centres(avenue_->scan(0), first);
  centres(avenue_->scan(10), last);
  int companions = 0;
  for (const auto& [instance, place] : first) {
    if (!last.contains(instance)) continue;
    const double was = place.first / place.second;
    const double is = last[instance].first / last[instance].second;
    if (std::abs(is - was) < 3.0) ++companions;
  }
  EXPECT_GE(companions, 3);
}

TEST_F(Avenue, StillShowsEnoughThatStands) {
  for (int i = 0; i < 100; i += 20) {
    const SimulatedScan out = avenue_->scan(i);
    const auto upright = std::ranges::count_if(out.scan.labels, [](SemanticClass label) {
      return label >= SemanticClass::building && label != SemanticClass::terrain;
    });
    EXPECT_GT(upright, 500);
  }
}

TEST_F(Avenue, NothingIsInsideTheEgoVehicle) {
  const Eigen::AlignedBox3f hull(Eigen::Vector3f(-2.2F, -0.85F, -1.5F),
                                 Eigen::Vector3f(2.2F, 0.85F, 0.2F));
  for (int i = 0; i < 100; i += 10) {
    for (const Eigen::Vector3f& point : avenue_->scan(i).scan.points_lidar) {
      EXPECT_FALSE(hull.contains(point)) << point.transpose();
    }
  }
}

TEST(QuietCity, HasTurnsParkedCarsAndLittleTraffic) {
  const Simulation quiet(with_plan(quiet_city(), 500));
  double share = 0.0;
  double driven_m = 0.0;
  double turned = 0.0;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Isometry3d step =
        quiet.T_map_lidar_at(i * 0.1).inverse() * quiet.T_map_lidar_at(i * 0.1 + 0.1);
    driven_m += step.translation().norm();
    turned += std::abs(std::atan2(step.linear()(1, 0), step.linear()(0, 0)));
    EXPECT_LT(step.translation().norm(), 2.0);
  }
  std::set<std::uint32_t> parked;
  for (int i = 0; i < 500; i += 50) {
    const SimulatedScan out = quiet.scan(i);
    share += moving_share(out) / 10.0;
    for (const std::uint32_t raw : out.raw_labels) {
      if ((raw & 0xFFFFU) == 10) parked.insert(raw >> 16U);
    }
  }
  EXPECT_GE(driven_m, 400.0);
  EXPECT_GT(turned, 4.0);
  EXPECT_LT(share, 0.03);
  EXPECT_GT(parked.size(), 40U);
}

TEST(QuietCity, ShowsAllKindsOfThings) {
  const Simulation quiet(with_plan(quiet_city(), 200));
  std::map<SemanticClass, int> seen;
  for (int i = 0; i < 200; i += 20) {
    for (const SemanticClass label : quiet.scan(i).scan.labels) ++seen[label];
  }
  for (const SemanticClass label :
       {SemanticClass::car, SemanticClass::road, SemanticClass::parking, SemanticClass::sidewalk,
        SemanticClass::building, SemanticClass::fence, SemanticClass::vegetation,
        SemanticClass::trunk, SemanticClass::terrain, SemanticClass::pole,
        SemanticClass::traffic_sign}) {
    EXPECT_GT(seen[label], 50) << name(label);
  }
}

TEST(QuietCity, KerbIsSeenAsAStep) {
  SimulationConfig config = with_plan(quiet_city(), 10);
  config.noise.range_sigma_m = 0.0;
  const SimulatedScan out = Simulation(config).scan(0);
  // Neighbours in a ring, one on the road or a bay and one on the sidewalk behind the kerb.
  constexpr std::size_t apart = 8;
  const auto is_driven = [&](std::size_t i) {
    return out.scan.labels[i] == SemanticClass::parking ||
           out.scan.labels[i] == SemanticClass::road;
  };
  std::vector<double> steps;
  for (std::size_t i = apart; i < out.scan.size(); ++i) {
    const Eigen::Vector3f across = out.scan.points_lidar[i] - out.scan.points_lidar[i - apart];
    const bool crosses = is_driven(i - apart) && out.scan.labels[i] == SemanticClass::sidewalk;
    if (crosses && out.scan.ring[i] == out.scan.ring[i - apart] && across.norm() < 1.0F) {
      steps.push_back((out.T_map_lidar.linear() * across.cast<double>()).z());
    }
  }
  ASSERT_GT(steps.size(), 10U);
  EXPECT_GT(*std::ranges::max_element(steps), 0.09);
  EXPECT_LT(*std::ranges::max_element(steps), 0.25);
}

TEST(QuietCity, GroundUnderTheLidarIsItsHeightBelow) {
  const SimulatedScan out = Simulation(with_plan(quiet_city(), 100)).scan(50);
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < out.scan.size(); ++i) {
    const Eigen::Vector3f& p = out.scan.points_lidar[i];
    if (out.scan.labels[i] != SemanticClass::road || p.head<2>().norm() > 5.0F) continue;
    sum += p.z();
    ++count;
  }
  ASSERT_GT(count, 1000);
  EXPECT_NEAR(sum / count, -1.73, 0.06);
}

TEST(Labels, OnlyObjectsThatCanBeCountedHaveInstances) {
  const SimulatedScan out = Simulation(with_plan(test_yard(), 5)).scan(0);
  ASSERT_EQ(out.raw_labels.size(), out.scan.size());
  EXPECT_TRUE(std::ranges::any_of(out.scan.labels, is_movable));
  for (std::size_t i = 0; i < out.raw_labels.size(); ++i) {
    EXPECT_EQ(out.raw_labels[i] >> 16U != 0, is_movable(out.scan.labels[i]));
  }
}

}  // namespace
}  // namespace stillmap::simulation
