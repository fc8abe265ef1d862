#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "core/lidar/shared_trajectory.hpp"
#include "core/localization/localizer.hpp"
#include "core/map/query/tile_reader.hpp"
#include "core/map/static_map.hpp"
#include "tests/lidar/boxes.hpp"

namespace stillmap::test {
namespace {

constexpr double length_m = 44.0;
constexpr double width_m = 26.0;
constexpr double storey_m = 3.0;
constexpr double lidar_height_m = 1.0;

/// A car park of two decks: slabs, walls, pillars at the same places, and other things on each.
class CarPark : public Boxes {
 public:
  explicit CarPark(bool has_ramp) {
    // Beside the decks, seen from both.
    for (int k = 0; has_ramp && k < 80; ++k)
      add({44.5, 1.0 + 0.3 * k, -0.3}, {51.5, 1.3 + 0.3 * k, storey_m * (k + 0.5) / 80.0});
    for (int storey = 0; storey <= 2; ++storey)
      add({0, 0, storey * storey_m - 0.3}, {length_m, width_m, storey * storey_m});
    for (int storey = 0; storey < 2; ++storey) {
      const double floor = storey * storey_m;
      add({-0.2, 0, floor}, {0, width_m, floor + 1.1});
      add({length_m, 0, floor}, {length_m + 0.2, width_m, floor + 1.1});
      add({0, -0.2, floor}, {length_m, 0, floor + 1.1});
      add({0, width_m, floor}, {length_m, width_m + 0.2, floor + 1.1});
    }
    // Stairs, and the houses that are seen from both.
    add({28, 9, 0}, {34, 13, 2 * storey_m});
    add({-14, -12, 0}, {-8, 9, 9});
    add({8, -19, 0}, {20, -11, 7});
    add({29, -16, 0}, {40, -8, 8});
    add({54, 2, 0}, {60, 21, 9});
    add({3, 37, 0}, {16, 45, 6.5});
    add({26, 33, 0}, {31, 40, 8});
    for (double x = 7.0; x < length_m; x += 10.0)
      for (const double y : {8.0, 18.0}) add({x, y, 0}, {x + 0.4, y + 0.4, 2 * storey_m});
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> share(0.0, 1.0);
    for (int storey = 0; storey < 2; ++storey) {
      for (int k = 0; k < 18; ++k) {
        const double x = 2.0 + share(random) * (length_m - 8.0);
        const double y = k % 3 == 0   ? 0.3 + share(random)
                         : k % 3 == 1 ? width_m - 2.5 + share(random)
                                      : 11.0 + 2.0 * share(random);
        add({x, y, storey * storey_m},
            {x + 1.0 + 3.0 * share(random), y + 1.3, storey * storey_m + 1.3 + share(random)});
      }
    }
  }

  /// By 32 rings.
  [[nodiscard]] Scan scan_at(const Eigen::Isometry3d& T_map_lidar, std::int64_t stamp_ns) const {
    Scan scan;
    scan.stamp_ns = stamp_ns;
    for (int ring = 0; ring < 32; ++ring) {
      const double elevation = (15.0 - ring * 40.0 / 31.0) * std::numbers::pi / 180.0;
      for (int k = 0; k < 720; ++k) {
        const Eigen::Vector3d ray = ray_at(elevation, k * std::numbers::pi / 360.0);
        const double hit_m = range_m(T_map_lidar.translation(), T_map_lidar.linear() * ray);
        if (hit_m > 80.0) continue;
        scan.points_lidar.push_back((hit_m * ray).cast<float>());
        scan.ring.push_back(static_cast<std::uint16_t>(ring));
      }
    }
    return scan;
  }
};

/// Round the deck; `share` of the way.
Eigen::Isometry3d pose(int storey, double share, double aside_m = 0.0) {
  const double angle = 2.0 * std::numbers::pi * share;
  const Eigen::Vector3d position(
      0.5 * length_m + (0.5 * length_m - 5.0 + aside_m) * std::cos(angle),
      0.5 * width_m + (0.5 * width_m - 5.0 + aside_m) * std::sin(angle),
      storey * storey_m + lidar_height_m);
  // Off the axes, for rays that miss no plane.
  return Eigen::Translation3d(position) * Eigen::AngleAxisd(angle + 1.5, Eigen::Vector3d::UnitZ());
}

std::shared_ptr<const PlaceIndex> index_of(const CarPark& park, bool has_ramp) {
  StaticMap map{StaticMapConfig{}};
  map.reset(1);
  SharedTrajectory path;
  for (int storey = 0; storey < 2; ++storey) {
    for (int k = 0; k < 60; ++k) {
      LabelledScan scan;
      const Eigen::Isometry3d T_map_lidar = pose(storey, k / 60.0);
      const std::int64_t stamp_ns = (60 * storey + k + 1) * 100'000'000LL;
      scan.scan = park.scan_at(T_map_lidar, stamp_ns);
      scan.motion.assign(scan.scan.size(), Motion::stationary);
      map.insert(scan, T_map_lidar);
      path.push_back({stamp_ns, T_map_lidar});
    }
  }
  // The way from deck to deck.
  for (int k = 0; has_ramp && k <= 60; ++k) {
    LabelledScan scan;
    const double share = k / 60.0;
    const Eigen::Isometry3d T_map_lidar =
        Eigen::Translation3d(48.0, 1.0 + 24.0 * share, share * storey_m + lidar_height_m) *
        Eigen::AngleAxisd(1.57, Eigen::Vector3d::UnitZ());
    const std::int64_t stamp_ns = (121 + k) * 100'000'000LL;
    scan.scan = park.scan_at(T_map_lidar, stamp_ns);
    scan.motion.assign(scan.scan.size(), Motion::stationary);
    map.insert(scan, T_map_lidar);
    path.push_back({stamp_ns, T_map_lidar});
  }
  return std::make_shared<const PlaceIndex>(map.view(), path,
                                            std::make_shared<TileReader>(nullptr));
}

void expect_found_on_its_deck(bool has_ramp) {
  const CarPark park(has_ramp);
  const Localizer localizer(index_of(park, has_ramp));
  std::array<int, 2> found{};
  for (int storey = 0; storey < 2; ++storey) {
    for (int k = 0; k < 8; ++k) {
      const Eigen::Isometry3d T_map_lidar = pose(storey, (k + 0.5) / 8.0, 0.7);
      const LocalizationResult result =
          localizer.localize(park.scan_at(T_map_lidar, 1), PointLabels{});
      if (result.status != LocalizationStatus::found) continue;
      const Eigen::Vector3d off =
          result.places.front().T_map_lidar.translation() - T_map_lidar.translation();
      EXPECT_LT(off.norm(), 0.3) << "deck " << storey << ", place " << k << ": " << off.transpose();
      ++found[static_cast<std::size_t>(storey)];
    }
  }
  EXPECT_GE(found[0], 4);
  EXPECT_GE(found[1], 4);
}

// On the deck above, a scan fits the one below well enough: pillars and walls are the same.
TEST(LocalizerOnStoreys, FindsTheDeckThatItIsOn) { expect_found_on_its_deck(false); }

TEST(LocalizerOnStoreys, FindsTheDeckWhereARampJoinsThem) { expect_found_on_its_deck(true); }

}  // namespace
}  // namespace stillmap::test
