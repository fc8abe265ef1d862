#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <numbers>
#include <random>

#include "core/localization/localizer.hpp"
#include "tests/lidar/boxes.hpp"
#include "tests/localization/driven_map.hpp"

namespace stillmap::test {
namespace {

constexpr double street_length_m = 130.0;
constexpr double front_height_m = 12.0;
constexpr double height_in_street_m = 1.9;

/// A street between smooth fronts, which poles and the gaps between houses alone tell the way
/// along; or without those, which nothing does.
class SmoothStreet : public Boxes {
 public:
  explicit SmoothStreet(bool is_bare) {
    add({-30.0, -30.0, -1.0}, {street_length_m + 30.0, 30.0, 0.0});
    if (is_bare) {
      add({-30.0, -12.0, 0.0}, {street_length_m + 30.0, -11.0, front_height_m});
      add({-30.0, 13.0, 0.0}, {street_length_m + 30.0, 14.0, front_height_m});
      return;
    }
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> share(0.0, 1.0);
    for (const double side : {-1.0, 1.0}) {
      for (double x = -25.0 * share(random); x < street_length_m;) {
        const double width_m = 18.0 + 24.0 * share(random);
        const double face_m = side > 0.0 ? 13.0 : 11.0;
        add({x, std::min(side * face_m, side * (face_m + 9.0)), 0.0},
            {x + width_m, std::max(side * face_m, side * (face_m + 9.0)), front_height_m});
        x += width_m + 3.0 * share(random);
      }
      for (double x = 15.0 * share(random); x < street_length_m; x += 16.0 + 14.0 * share(random))
        add({x, side * 8.5, 0.0}, {x + 0.15, side * 8.5 + 0.15, 6.0});
    }
  }

  [[nodiscard]] Scan scan_at(const Eigen::Isometry3d& T_map_lidar, std::int64_t stamp_ns) const {
    return scan_of(*this, T_map_lidar, stamp_ns, 900, 100.0);
  }
};

Eigen::Isometry3d pose_in_street(double x, double y, double heading_rad) {
  return pose_off_axes(x, y, height_in_street_m, heading_rad);
}

/// The map of a drive from one end to the other.
std::shared_ptr<const PlaceIndex> index_of(const SmoothStreet& street) {
  return index_of_drive(
      90, [](int k) { return pose_in_street(10.0 + 1.2 * k, 0.0, 0.002); },
      [&](const Eigen::Isometry3d& T_map_lidar, std::int64_t stamp_ns) {
        return street.scan_at(T_map_lidar, stamp_ns);
      });
}

/// The points of two scans do not meet, and the rings on a front lie best on those of the map.
TEST(SmoothStreetPlaces, AreFoundWhereTheyAreAndNotWhereTheMapsRingsLie) {
  const SmoothStreet street(false);
  const Localizer localizer(index_of(street));
  for (int k = 0; k < 8; ++k) {
    const Eigen::Isometry3d T_map_lidar =
        pose_in_street(20.3 + 11.7 * k, 3.2, std::numbers::pi - 0.01);
    const LocalizationQuery query(street.scan_at(T_map_lidar, 1000 + k), {},
                                  Eigen::Matrix3d::Identity());
    for (const double way_m : {-0.6, 0.6}) {
      const PlaceHypothesis place =
          localizer.align_at(query, Eigen::Translation3d(way_m, 0.0, 0.0) * T_map_lidar);
      EXPECT_TRUE(is_believed(place.evidence, localizer.config()));
      EXPECT_FALSE(place.may_slide);
      const Eigen::Isometry3d off = T_map_lidar.inverse() * place.T_map_lidar;
      EXPECT_LT(off.translation().norm(), 0.1) << k << " from " << way_m;
    }
  }
}

/// Somebody says where it is, so that no place a metre and a half on is looked at; how far along
/// the street it is nothing shows.
TEST(SmoothStreetPlaces, AreAmbiguousWhereNothingShowsTheWayAlong) {
  const SmoothStreet street(true);
  const Localizer localizer(index_of(street));
  const Eigen::Isometry3d T_map_lidar = pose_in_street(62.4, 0.5, 0.01);
  const LocalizationQuery query(street.scan_at(T_map_lidar, 1000), {}, Eigen::Matrix3d::Identity());
  const LocalizationResult near =
      localizer.localize(query, SearchRegion{.centre_map = T_map_lidar.translation().head<2>(),
                                             .radius_m = 1.0,
                                             .heading_rad = 0.0,
                                             .max_turn_rad = 0.2});
  ASSERT_FALSE(near.places.empty());
  EXPECT_TRUE(is_believed(near.places.front().evidence, localizer.config()));
  EXPECT_EQ(near.status, LocalizationStatus::ambiguous);
  EXPECT_EQ(judge_places(near.places, localizer.config(), true), LocalizationStatus::found);
}

}  // namespace
}  // namespace stillmap::test
