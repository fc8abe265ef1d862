#include <gtest/gtest.h>

#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "core/localization/localizer.hpp"
#include "tests/lidar/boxes.hpp"
#include "tests/localization/driven_map.hpp"

namespace stillmap::test {
namespace {

constexpr double pitch_m = 22.0;
constexpr int houses = 7;
constexpr double lidar_height_in_row_m = 1.8;

/// A street of houses that are built by a few plans, one after another. Fronts stand farther back
/// by this or that, every other one by `far_back_m`, and lamps, bins and garages as it happened.
class RowOfHouses : public Boxes {
 public:
  RowOfHouses(unsigned seed, int plans, double far_back_m) {
    add({-40, -45, -1}, {houses * pitch_m + 40, 45, 0});
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> share(0.0, 1.0);
    for (int k = 0; k < houses; ++k) {
      for (const double side : {-1.0, 1.0}) {
        const double x = k * pitch_m;
        const double back_m = share(random) < 0.5 ? far_back_m : 0.4 * share(random);
        std::mt19937_64 plan(static_cast<std::uint64_t>(100 + 2 * (k % plans)) +
                             (side > 0 ? 1 : 0));
        const double width_m = 10.0 + 5.0 * share(plan);
        const double porch_m = 2.0 + 5.0 * share(plan);
        const double front_m = 9.0 + 3.0 * share(plan) + back_m;
        add_beside(side, x, x + width_m, front_m, front_m + 10.0, 9.0);
        add_beside(side, x + porch_m, x + porch_m + 2.5, front_m - 1.4, front_m, 3.2);
        if (share(random) < 0.5) add_beside(side, x + 16.0, x + 19.0, 11.0, 17.0, 3.0);
        const double lamp_m = x + pitch_m * share(random);
        add_beside(side, lamp_m, lamp_m + 0.2, 5.6, 5.8, 6.0);
        const double bin_m = x + pitch_m * share(random);
        add_beside(side, bin_m, bin_m + 1.2, 6.6, 7.4, 1.3);
      }
    }
  }

  [[nodiscard]] Scan scan_at(const Eigen::Isometry3d& T_map_lidar, std::int64_t stamp_ns) const {
    return scan_of(*this, T_map_lidar, stamp_ns, 720, 90.0);
  }

 private:
  void add_beside(double side, double x_low, double x_high, double y_near, double y_far,
                  double height_m) {
    add({x_low, std::min(side * y_near, side * y_far), 0.0},
        {x_high, std::max(side * y_near, side * y_far), height_m});
  }
};

Eigen::Isometry3d pose_in_row(double x, double y, double heading_rad) {
  return pose_off_axes(x, y, lidar_height_in_row_m, heading_rad);
}

/// The map of a drive along it.
std::shared_ptr<const PlaceIndex> index_of(const RowOfHouses& row) {
  return index_of_drive(
      100, [](int k) { return pose_in_row(5.0 + 1.3 * k, 0.0, 0.002); },
      [&](const Eigen::Isometry3d& T_map_lidar, std::int64_t stamp_ns) {
        return row.scan_at(T_map_lidar, stamp_ns);
      });
}

Eigen::Isometry3d place_in_row(int k) {
  return pose_in_row(20.3 + 9.7 * k, 1.6, k % 2 == 0 ? 0.01 : std::numbers::pi - 0.01);
}

/// The houses beside fit roughly as well.
TEST(LookAlikes, InTheMapAreToldApartByWhatFitsClosely) {
  const RowOfHouses row(3, 1, 0.9);
  const Localizer localizer(index_of(row));
  int found = 0;
  for (int k = 0; k < 10; ++k) {
    const Eigen::Isometry3d T_map_lidar = place_in_row(k);
    const LocalizationResult result = localizer.localize(row.scan_at(T_map_lidar, 77 + k), {});
    ASSERT_FALSE(result.places.empty());
    const Eigen::Isometry3d off = T_map_lidar.inverse() * result.places.front().T_map_lidar;
    EXPECT_LT(off.translation().norm(), 0.1) << k;
    found += result.status == LocalizationStatus::found ? 1 : 0;
  }
  EXPECT_GE(found, 7);
}

/// Another street of the same houses in the same order, which the map does not hold.
TEST(LookAlikes, BesideTheMapAreNotTakenForWhatItHolds) {
  const Localizer localizer(index_of(RowOfHouses(3, houses, 0.6)));
  const RowOfHouses elsewhere(4, houses, 1.4);
  for (int k = 0; k < 10; ++k) {
    const LocalizationResult result =
        localizer.localize(elsewhere.scan_at(place_in_row(k), 77 + k), {});
    EXPECT_NE(result.status, LocalizationStatus::found) << k;
  }
}

/// A place that only looks like the best one is no rival if it fits less closely; one that fits as
/// closely is, and what fits loosely tells nothing apart.
TEST(LookAlikes, AreJudgedByWhatIsClose) {
  const auto status = [](double close, double other_close, int other_map_points = 5000) {
    PlaceHypothesis best;
    best.evidence = {.explained = 0.95,
                     .confirmed = 1.0,
                     .level = 1.0,
                     .scan_points = 500,
                     .map_points = 5000,
                     .level_points = 500,
                     .close = close};
    PlaceHypothesis other = best;
    other.evidence.explained = 0.9;
    other.evidence.close = other_close;
    other.evidence.map_points = other_map_points;
    return judge_places(std::vector{best, other}, LocalizationConfig{});
  };
  EXPECT_EQ(status(0.8, 0.4), LocalizationStatus::found);
  EXPECT_EQ(status(0.8, 0.7), LocalizationStatus::ambiguous);
  EXPECT_EQ(status(0.4, 0.1), LocalizationStatus::ambiguous);
  EXPECT_EQ(status(0.8, 0.4, 3000), LocalizationStatus::ambiguous)
      << "a place that the map knows thinly";
}

TEST(LookAlikes, OneThatHeightsDenyStaysARivalOfTheOneThatIsBelieved) {
  PlaceHypothesis denied;
  denied.evidence = {.explained = 0.95,
                     .confirmed = 1.0,
                     .level = 1.0,
                     .scan_points = 500,
                     .map_points = 5000,
                     .level_points = 500};
  PlaceHypothesis believed = denied;
  believed.evidence.explained = 0.9;
  denied.evidence.high_agreed = 0.5;
  const LocalizationConfig config;
  std::vector<PlaceHypothesis> places{denied, believed};
  EXPECT_EQ(judge_places(places, config), LocalizationStatus::not_found);
  put_believed_first(places, config);
  EXPECT_EQ(places[0].evidence.explained, 0.9);
  EXPECT_EQ(judge_places(places, config), LocalizationStatus::ambiguous);
}

}  // namespace
}  // namespace stillmap::test
