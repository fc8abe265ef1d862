#include "core/dataset/scan_remarks.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/dataset/scan_dataset.hpp"
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

TEST(ArePartsOfATurn, WhereScansSeeOtherDirections) {
  const Scan left = street(0.0, 180.0), right = street(-180.0, 0.0);
  EXPECT_TRUE(are_parts_of_a_turn(left, right));
  EXPECT_TRUE(are_parts_of_a_turn(street(-175.0, -55.0), street(-55.0, 65.0)));
  // Lidars that see a part of all directions, each time the same, or nearly all.
  EXPECT_FALSE(are_parts_of_a_turn(left, left));
  EXPECT_FALSE(are_parts_of_a_turn(street(-180.0, 144.0), street(-144.0, 180.0)));
  EXPECT_FALSE(are_parts_of_a_turn(left, Scan()));
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
  // Two scans tell nothing.
  EXPECT_THAT(remarks_on(2, upside_down), Not(Contains(HasSubstr("is up"))));
}

}  // namespace
}  // namespace stillmap
