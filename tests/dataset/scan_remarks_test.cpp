#include "core/dataset/scan_remarks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/dataset/scan_dataset.hpp"
#include "core/lidar/other_axes.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// What 24 rings see from 1.8 m above the ground between azimuths [deg]: the ground to 25 m and
/// houses, and with a roof what is 1.5 m above the lidar.
Scan street(double from_deg, double to_deg, bool has_roof = false) {
  constexpr double per_degree = std::numbers::pi / 180.0;
  Scan scan;
  for (int ring = 0; ring < 24; ++ring) {
    const double elevation = (10.0 - 1.5 * ring) * per_degree;
    for (double azimuth_deg = from_deg; azimuth_deg < to_deg; azimuth_deg += 1.0) {
      double range_m = azimuth_deg < 0.0 ? 15.0 : 25.0;
      if (elevation < 0.0) range_m = std::min(range_m, 1.8 / -std::tan(elevation));
      if (elevation > 0.0 && has_roof) range_m = std::min(range_m, 1.5 / std::tan(elevation));
      const double azimuth = azimuth_deg * per_degree;
      scan.points_lidar.push_back(
          (range_m * Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), std::tan(elevation)))
              .cast<float>());
    }
  }
  return scan;
}

/// A PLY of x y z, ascii.
std::string ply_of(const Scan& scan) {
  std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(scan.size()) +
                     "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  for (const Eigen::Vector3f& p : scan.points_lidar)
    text +=
        std::to_string(p.x()) + " " + std::to_string(p.y()) + " " + std::to_string(p.z()) + "\n";
  return text;
}

/// The remarks on so many scans that `scan_of(k)` makes.
template <class ScanOf>
std::vector<std::string> remarks_on(std::size_t scans, ScanOf scan_of) {
  const ScratchFolder folder;
  for (std::size_t k = 0; k < scans; ++k)
    (void)folder.file(std::to_string(k) + ".ply", ply_of(scan_of(k)));
  return ScanDataset(folder.path()).remarks();
}

TEST(OtherUpAxis, IsToldByTheGround) {
  const std::vector<Eigen::Vector3f> ours = street(-180.0, 180.0).points_lidar;
  EXPECT_EQ(other_up_axis(ours), std::nullopt);
  const auto up_of = [&](auto other) {
    std::vector<Eigen::Vector3f> points;
    for (const Eigen::Vector3f& p : ours) points.push_back(other(p));
    return other_up_axis(points);
  };
  using P = const Eigen::Vector3f&;
  EXPECT_EQ(up_of([](P p) { return Eigen::Vector3f(p.x(), -p.y(), p.z()); }), std::nullopt);
  EXPECT_EQ(up_of([](P p) { return Eigen::Vector3f(p.x(), -p.y(), -p.z()); }), "-z");
  EXPECT_EQ(up_of([](P p) { return Eigen::Vector3f(-p.y(), p.z(), p.x()); }), "y");
  EXPECT_EQ(up_of([](P p) { return Eigen::Vector3f(p.z(), p.x(), p.y()); }), "x");
  // Upside down under a roof nobody knows.
  for (Scan scan = street(-180.0, 180.0, true); const float sign : {1.0F, -1.0F}) {
    for (Eigen::Vector3f& p : scan.points_lidar) p.z() *= sign;
    EXPECT_EQ(other_up_axis(scan.points_lidar), std::nullopt);
  }
  // Nor do two walls.
  std::vector<Eigen::Vector3f> corridor;
  for (const Eigen::Vector3f& p : street(-180.0, 180.0, true).points_lidar)
    corridor.emplace_back(p.x(), p.z(), 0.3F * p.y());
  EXPECT_EQ(other_up_axis(corridor), std::nullopt);
  EXPECT_EQ(other_up_axis({}), std::nullopt);
  EXPECT_EQ(other_up_axis(std::vector<Eigen::Vector3f>(2000, Eigen::Vector3f::Constant(NAN))),
            std::nullopt);
  EXPECT_EQ(other_up_axis(std::vector<Eigen::Vector3f>(2000, Eigen::Vector3f(1, 2, 3))),
            std::nullopt);
}

/// What a lidar sees in a room of so many metres, through its middle, between the elevations, as it
/// turns by `turn_deg` to both sides: the floor so far below it, the ceiling so far above.
struct Room {
  double long_m = 8.0;
  double wide_m = 6.0;
  double floor_m = 1.0;
  double ceiling_m = 1.8;
};
std::vector<Eigen::Vector3f> in_room(const Room& room, double low_deg, double high_deg,
                                     double turn_deg = 180.0) {
  constexpr double per_degree = std::numbers::pi / 180.0;
  std::vector<Eigen::Vector3f> points;
  const double step_deg = (high_deg - low_deg) / 24.0;
  for (double elevation_deg = low_deg; elevation_deg <= high_deg; elevation_deg += step_deg) {
    for (double azimuth_deg = -turn_deg; azimuth_deg < turn_deg; azimuth_deg += 1.0) {
      const double up = std::sin(elevation_deg * per_degree);
      const double level = std::cos(elevation_deg * per_degree);
      const Eigen::Vector3d ray(level * std::cos(azimuth_deg * per_degree),
                                level * std::sin(azimuth_deg * per_degree), up);
      const double to_level = up < 0.0 ? room.floor_m / -up : room.ceiling_m / std::max(up, 1e-9);
      const double range_m =
          std::min({to_level, 0.5 * room.long_m / std::max(std::abs(ray.x()), 1e-9),
                    0.5 * room.wide_m / std::max(std::abs(ray.y()), 1e-9)});
      points.push_back((range_m * ray).cast<float>());
    }
  }
  return points;
}

TEST(OtherUpAxis, IsNotGuessedFromCeilingsAndWalls) {
  // Low lidars under a ceiling, and between shelves.
  for (const double floor_m : {0.15, 0.2, 0.28}) {
    const Room garage{.long_m = 40.0, .wide_m = 30.0, .floor_m = floor_m, .ceiling_m = 2.1};
    EXPECT_EQ(other_up_axis(in_room(garage, -15.0, 15.0)), std::nullopt) << floor_m;
    const Room narrow{.long_m = 30.0, .wide_m = 1.6, .floor_m = floor_m, .ceiling_m = 50.0};
    EXPECT_EQ(other_up_axis(in_room(narrow, -15.0, 15.0)), std::nullopt) << floor_m;
    std::vector<Eigen::Vector3f> beside_a_wall;
    for (const Eigen::Vector3f& p : in_room(narrow, -15.0, 15.0))
      if (p.y() > -0.7F) beside_a_wall.push_back(p);
    EXPECT_EQ(other_up_axis(beside_a_wall), std::nullopt) << floor_m;
  }
  // Those that see little of the floor, or nothing, in rooms and halls.
  for (const double size : {1.0, 1.5, 2.0, 3.0, 5.0, 8.0}) {
    for (const double floor_m : {0.5, 1.0, 1.5}) {
      for (const double ceiling_m : {1.0, 1.8, 3.0}) {
        const Room room{
            .long_m = 8.0 * size, .wide_m = 6.0 * size, .floor_m = floor_m, .ceiling_m = ceiling_m};
        EXPECT_EQ(other_up_axis(in_room(room, -7.0, 52.0)), std::nullopt)
            << size << " " << floor_m << " " << ceiling_m;
        EXPECT_EQ(other_up_axis(in_room(room, 0.0, 89.0)), std::nullopt)
            << size << " " << floor_m << " " << ceiling_m;
      }
    }
  }
  // Forward ones before a wall.
  for (const double wall_m : {0.6, 1.5, 3.5}) {
    const Room wall{.long_m = 2.0 * wall_m, .wide_m = 60.0, .floor_m = 30.0, .ceiling_m = 30.0};
    EXPECT_EQ(other_up_axis(in_room(wall, -38.0, 38.0, 35.0)), std::nullopt) << wall_m;
  }
}

TEST(ArePartsOfATurn, WhereScansSeeOtherDirections) {
  const Scan left = street(0.0, 180.0), right = street(-180.0, 0.0);
  EXPECT_TRUE(are_parts_of_a_turn(left, right));
  EXPECT_TRUE(are_parts_of_a_turn(street(-175.0, -55.0), street(-55.0, 65.0)));
  // Lidars that see a part of all directions, each time the same, or nearly all.
  EXPECT_FALSE(are_parts_of_a_turn(left, left));
  EXPECT_FALSE(are_parts_of_a_turn(street(-180.0, 144.0), street(-144.0, 180.0)));
  EXPECT_FALSE(are_parts_of_a_turn(left, Scan()));
}

/// Takes so many scans, and says how often what they show changed.
template <class ScanOf>
int changes_of(ScanDoubts& doubts, int scans, ScanOf scan_of) {
  int changes = 0;
  for (int k = 0; k < scans; ++k) changes += doubts.add(scan_of(k)) ? 1 : 0;
  return changes;
}

TEST(ScanDoubts, AreSaidOnceWhereThreeLooksAgreeAndWithdrawnWhereThreeDoNot) {
  const Scan ours = street(-180.0, 180.0), left = street(0.0, 180.0), right = street(-180.0, 0.0);
  Scan upside_down = ours;
  for (Eigen::Vector3f& p : upside_down.points_lidar) p.z() *= -1.0F;
  ScanDoubts doubts(false);
  EXPECT_EQ(changes_of(doubts, 500, [&](int) { return ours; }), 0);
  // A look that another one contradicts says nothing.
  EXPECT_EQ(changes_of(doubts, 100, [&](int) { return upside_down; }), 0);
  EXPECT_EQ(changes_of(doubts, 50, [&](int) { return ours; }), 0);
  EXPECT_EQ(changes_of(doubts, 500, [&](int) { return upside_down; }), 1);
  EXPECT_EQ(doubts.said().up, "-z");
  EXPECT_FALSE(doubts.said().are_parts);
  EXPECT_EQ(changes_of(doubts, 500, [&](int) { return ours; }), 1);
  EXPECT_EQ(doubts.said().up, std::nullopt);
  EXPECT_EQ(changes_of(doubts, 500, [&](int k) { return k % 2 == 0 ? left : right; }), 1);
  EXPECT_TRUE(doubts.said().are_parts);

  ScanDoubts of_a_known_mount(true);
  EXPECT_EQ(changes_of(of_a_known_mount, 500, [&](int) { return upside_down; }), 0);
}

TEST(RemarksOnScans, SayWhatASimulatorsScansAre) {
  EXPECT_THAT(remarks_on(8, [](auto) { return street(-180.0, 180.0); }),
              Not(Contains(testing::AnyOf(HasSubstr("is up"), HasSubstr("turn")))));
  EXPECT_THAT(
      remarks_on(
          8, [](std::size_t k) { return k % 2 == 0 ? street(0.0, 180.0) : street(-180.0, 0.0); }),
      Contains(HasSubstr("parts of one turn")));
  const auto upside_down = [](auto) {
    Scan scan = street(-180.0, 180.0);
    for (Eigen::Vector3f& p : scan.points_lidar) p.z() *= -1.0F;
    return scan;
  };
  EXPECT_THAT(remarks_on(8, upside_down), Contains(HasSubstr("-z is up")));
  // Whoever says how it hangs knows.
  const ScratchFolder folder;
  for (std::size_t k = 0; k < 8; ++k)
    (void)folder.file(std::to_string(k) + ".ply", ply_of(upside_down(k)));
  EXPECT_THAT(ScanDataset(folder.path()).remarks(true), Not(Contains(HasSubstr("is up"))));
  // Two scans tell nothing.
  EXPECT_THAT(remarks_on(2, upside_down), Not(Contains(HasSubstr("is up"))));
}

}  // namespace
}  // namespace stillmap
