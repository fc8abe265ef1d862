#include "core/segmentation/lidar_stance.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "core/lidar/angle_units.hpp"
#include "core/segmentation/network_segmenter.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

Eigen::Matrix3d leaning(double roll_deg, double pitch_deg) {
  return (Eigen::AngleAxisd(pitch_deg * rad_per_deg, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_deg * rad_per_deg, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

/// Ground that rises by `slope_ahead` from `rise_from_m` ahead on, in a court of 50 m x 36 m whose
/// middle the lidar is over, as its 40 beams see them.
struct Court {
  double height_m = 1.7;
  Eigen::Matrix3d R_world_lidar = Eigen::Matrix3d::Identity();
  double slope_ahead = 0.0;
  double rise_from_m = 0.0;

  [[nodiscard]] std::vector<Eigen::Vector3f> scan() const {
    std::vector<Eigen::Vector3f> points;
    for (int beam = 0; beam < 40; ++beam) {
      const double elevation = (8.0 - 0.8 * beam) * rad_per_deg;
      for (int column = 0; column < 720; ++column) {
        const double azimuth = (0.5 * column + 0.1) * rad_per_deg;
        const Eigen::Vector3d beam_lidar(std::cos(elevation) * std::cos(azimuth),
                                         std::cos(elevation) * std::sin(azimuth),
                                         std::sin(elevation));
        points.push_back((distance_m(R_world_lidar * beam_lidar) * beam_lidar).cast<float>());
      }
    }
    return points;
  }

 private:
  [[nodiscard]] double distance_m(const Eigen::Vector3d& beam) const {
    double nearest_m = std::min(25.0 / std::abs(beam.x()), 18.0 / std::abs(beam.y()));
    if (beam.z() < 0.0 && height_m * beam.x() / -beam.z() <= rise_from_m)
      nearest_m = std::min(nearest_m, height_m / -beam.z());
    const double falls = slope_ahead * beam.x() - beam.z();
    const double to_rise_m = (height_m + slope_ahead * rise_from_m) / falls;
    if (falls > 0.0 && to_rise_m * beam.x() > rise_from_m)
      nearest_m = std::min(nearest_m, to_rise_m);
    return nearest_m;
  }
};

TEST(LidarStance, IsReadOffTheGround) {
  const Court upright{.height_m = 0.6};
  const auto stance = stance_over_ground(upright.scan());
  ASSERT_TRUE(stance);
  EXPECT_NEAR(stance->height_m, 0.6, 0.02);
  EXPECT_LT(stance->tilt_rad, 0.2 * rad_per_deg);
  for (const auto& [roll_deg, pitch_deg] : {std::pair(0.0, 6.0), {-9.0, 4.0}, {0.0, -15.0}}) {
    const Eigen::Matrix3d R_world_lidar = leaning(roll_deg, pitch_deg);
    const auto found = stance_over_ground(Court{.R_world_lidar = R_world_lidar}.scan());
    ASSERT_TRUE(found) << roll_deg << ' ' << pitch_deg;
    EXPECT_NEAR(found->height_m, 1.7, 0.03);
    EXPECT_NEAR(found->tilt_rad, std::acos(R_world_lidar(2, 2)), 0.3 * rad_per_deg);
    EXPECT_LT((found->R_level_lidar.row(2) - R_world_lidar.row(2)).norm(), 0.006);
  }
}

TEST(LidarStance, IsNotThatAgainstARiseAhead) {
  for (const double rise_from_m : {1.0, 4.0, 8.0}) {
    for (const double slope : {0.06, 0.1, 0.2, 0.3}) {
      const auto found =
          stance_over_ground(Court{.slope_ahead = slope, .rise_from_m = rise_from_m}.scan());
      EXPECT_LT(found ? found->tilt_rad : 0.0, 3.0 * rad_per_deg) << slope << ' ' << rise_from_m;
    }
  }
}

/// Beams of a lidar, evenly spaced.
struct Beams {
  int count = 64;
  double highest_deg = 2.0;
  double step_deg = 0.425;
};

/// A lidar over a road, and how it leans.
struct OverRoad {
  double height_m = 1.73;
  Eigen::Matrix3d R_world_lidar = Eigen::Matrix3d::Identity();
};

/// Of ground whose height at y is `height_at_m(y)`, for a lidar over that at 0, as these beams see
/// it within 60 m.
template <typename HeightAt>
std::vector<Eigen::Vector3f> scan_along_road(HeightAt height_at_m, const Beams& beams = {},
                                             const OverRoad& lidar = {}) {
  constexpr double reach_m = 60.0, step_m = 0.05;
  const double lidar_m = lidar.height_m + height_at_m(0.0);
  std::vector<Eigen::Vector3f> points;
  for (int beam = 0; beam < beams.count; ++beam) {
    const double slope = std::tan((beams.highest_deg - beams.step_deg * beam) * rad_per_deg);
    for (int column = 0; column < 360; ++column) {
      const double azimuth = (column + 0.3) * rad_per_deg;
      const Eigen::Vector3d beam_lidar(std::cos(azimuth), std::sin(azimuth), slope);
      const Eigen::Vector3d beam_world = lidar.R_world_lidar * beam_lidar;
      for (double r = 1.0; r < reach_m; r += step_m) {
        if (lidar_m + r * beam_world.z() > height_at_m(r * beam_world.y())) continue;
        points.push_back((r * beam_lidar).cast<float>());
        break;
      }
    }
  }
  return points;
}

TEST(LidarStance, IsNotThatAgainstTheFieldsBesideARoad) {
  EXPECT_TRUE(stance_over_ground(scan_along_road([](double) { return 0.0; })));
  for (const double half_width_m : {3.0, 4.0}) {
    for (const double lower_m : {0.4, 0.6, 1.0}) {
      const auto stance = stance_over_ground(scan_along_road([&](double y) {
        return std::max(-lower_m, -0.5 * std::max(0.0, std::abs(y) - half_width_m));
      }));
      EXPECT_NEAR(stance ? stance->height_m : 1.73, 1.73, 0.1) << half_width_m << ' ' << lower_m;
    }
  }
}

/// A level lane along a slope, and an upright lidar on it.
struct LaneInSlope {
  double half_width_m = 2.0;
  double slope_deg = 8.0;
  /// Cut into the slope, with sides of 45 degrees; or else the slope begins at its edges.
  bool is_cut = false;
  /// From the middle of the lane to the lidar.
  double off_m = 0.0;

  [[nodiscard]] std::optional<LidarStance> found(const Beams& beams,
                                                 const OverRoad& lidar = {}) const {
    return stance_over_ground(
        scan_along_road([&](double y) { return height_m(y + off_m); }, beams, lidar));
  }

  [[nodiscard]] double found_tilt_deg(const Beams& beams) const {
    const auto stance = found(beams);
    return stance ? stance->tilt_rad / rad_per_deg : 0.0;
  }

 private:
  [[nodiscard]] double height_m(double y) const {
    const double slope = std::tan(slope_deg * rad_per_deg);
    const double beside_m = std::max(0.0, std::abs(y) - half_width_m);
    return std::copysign(is_cut ? std::min(slope * std::abs(y), beside_m) : slope * beside_m, y);
  }
};

constexpr Beams hdl_64e, vlp_16{.count = 16, .highest_deg = 15.0, .step_deg = 2.0};

TEST(LidarStance, IsNotThatAgainstTheSlopeThatALevelLaneIsIn) {
  std::vector<LaneInSlope> lanes;
  for (const double half_width_m : {2.0, 3.0}) {
    for (const double slope_deg : {8.0, 10.0}) {
      for (const bool is_cut : {false, true}) {
        for (const double off_m : {-1.0, 0.0, 1.0})
          lanes.push_back({half_width_m, slope_deg, is_cut, off_m});
      }
    }
  }
  for (const LaneInSlope& lane : lanes) {
    EXPECT_LT(lane.found_tilt_deg(hdl_64e), 3.0)
        << lane.half_width_m << ' ' << lane.slope_deg << ' ' << lane.is_cut << ' ' << lane.off_m;
    EXPECT_LT(lane.found_tilt_deg(vlp_16), 3.0)
        << lane.half_width_m << ' ' << lane.slope_deg << ' ' << lane.is_cut << ' ' << lane.off_m;
  }
}

TEST(LidarStance, HasItsHeightInALaneInASlopeTooSlightForALean) {
  const LaneInSlope lane{.slope_deg = 3.5, .is_cut = true};
  for (const Beams& beams : {hdl_64e, vlp_16}) {
    const auto stance = lane.found(beams, {.height_m = 2.3});
    ASSERT_TRUE(stance) << beams.count;
    EXPECT_NEAR(stance->height_m, 2.3, 0.15) << beams.count;
    EXPECT_LT(stance->tilt_rad, least_seen_tilt_rad) << beams.count;
  }
}

TEST(LidarStance, IsReadOffTheGroundBesideAKerb) {
  struct Step {
    double at_m = 0.0, rise_m = 0.0;
  };
  // Kerbs beside a road, and a road beside a pavement that the lidar is on.
  constexpr double kerb_m = 0.12, road_m = -0.15;
  for (const Step& step : std::vector<Step>{
           {0.5, kerb_m}, {1.0, kerb_m}, {0.5, road_m}, {1.0, road_m}, {1.5, road_m}}) {
    for (const double roll_deg : {-6.0, 6.0}) {
      for (const Beams& beams : {hdl_64e, vlp_16}) {
        const auto stance = stance_over_ground(
            scan_along_road([&](double y) { return y > step.at_m ? step.rise_m : 0.0; }, beams,
                            {.R_world_lidar = leaning(roll_deg, 0.0)}));
        ASSERT_TRUE(stance) << step.at_m << ' ' << step.rise_m << ' ' << roll_deg << ' '
                            << beams.count;
        EXPECT_NEAR(stance->tilt_rad, 6.0 * rad_per_deg, 1.0 * rad_per_deg);
      }
    }
  }
}

TEST(LidarStance, NeedsGround) {
  EXPECT_FALSE(stance_over_ground({}));
  const std::vector<Eigen::Vector3f> nothing(
      1000, Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()));
  EXPECT_FALSE(stance_over_ground(nothing));
  // Walls alone, and the ground of a frame whose origin lies on it.
  std::vector<Eigen::Vector3f> walls = Court{}.scan();
  std::erase_if(walls, [](const Eigen::Vector3f& p) { return p.z() < -1.6F; });
  EXPECT_FALSE(stance_over_ground(walls));
  std::vector<Eigen::Vector3f> lowered = Court{}.scan();
  for (Eigen::Vector3f& p : lowered) p.z() += 1.7F;
  EXPECT_FALSE(stance_over_ground(lowered));
}

TEST(LidarStance, LeavesOutWhatOnlyJustLiesWithinReach) {
  // 20 m less a hair, to which 20 m added make 40 m, one square metre too far.
  std::vector<Eigen::Vector3f> points = Court{}.scan();
  const float edge_m = std::nextafter(20.0F, 0.0F);
  for (const float x : {0.0F, 1e-4F}) {
    points.emplace_back(x, edge_m, -50.0F);
    points.emplace_back(edge_m, x, -50.0F);
  }
  const auto stance = stance_over_ground(points);
  ASSERT_TRUE(stance);
  EXPECT_NEAR(stance->height_m, 1.7, 0.03);
}

TEST(LidarStance, TellsAlongWhichAxesTheBeamsHaveRows) {
  const std::vector<Eigen::Vector3f> leans = Court{.R_world_lidar = leaning(0.0, 6.0)}.scan();
  std::vector<Eigen::Vector3f> level = leans;
  for (Eigen::Vector3f& p : level) p = leaning(0.0, 6.0).cast<float>() * p;
  EXPECT_TRUE(has_fewer_elevations(leans, level));
  EXPECT_FALSE(has_fewer_elevations(level, leans));
  EXPECT_FALSE(has_fewer_elevations(leans, leans));
  EXPECT_FALSE(has_fewer_elevations({}, {}));
}

/// Keeps how high all that the last image showed lies, as the network has it [m].
class KeepsHeights final : public SegmentationNetwork {
 public:
  KeepsHeights(const InputStatistics& statistics, std::vector<float>& heights_m)
      : statistics_(statistics), heights_m_(heights_m) {}
  PixelOutputs run(std::span<const float> input) override {
    const std::size_t pixels = input.size() / plain_input_channels;
    const auto heights = input.subspan(index(InputChannel::z) * pixels, pixels);
    heights_m_.clear();
    for (const float z : heights) {
      if (z != 0.0F)
        heights_m_.push_back(z * statistics_.deviation[index(InputChannel::z)] +
                             statistics_.mean[index(InputChannel::z)]);
    }
    std::ranges::sort(heights_m_);
    return {.output = std::vector<std::uint8_t>(pixels, 9),
            .confidence = std::vector(pixels, 1.0F)};
  }
  std::vector<float> probabilities(std::span<const float> /*input*/) override { return {}; }
  [[nodiscard]] std::string engine() const override { return "keeps heights"; }

 private:
  InputStatistics statistics_;
  std::vector<float>& heights_m_;
};

TEST(NetworkSegmenterOfAnUntoldMount, ShowsTheGroundLevelAndAsDeepAsUsual) {
  ModelDescription model = test::describe_family(64, 512, 20);
  model.follow_sensor = true;
  model.lidar_height_m = 1.7;
  std::vector<float> heights_m;
  NetworkSegmenter labels(model, std::make_unique<KeepsHeights>(model.statistics, heights_m));
  const auto shows_level_ground = [&](const Scan& scan) {
    static_cast<void>(labels.segment(scan));
    // Ground takes up most of the image: its tenth and its middle are as high.
    return std::abs(heights_m[heights_m.size() / 50] + 1.7F) < 0.1F &&
           std::abs(heights_m[heights_m.size() / 3] + 1.7F) < 0.1F;
  };
  Scan scan;
  for (const double pitch_deg : {0.0, 6.0, 12.0}) {
    scan.points_lidar = Court{.R_world_lidar = leaning(0.0, pitch_deg)}.scan();
    EXPECT_TRUE(shows_level_ground(scan)) << pitch_deg;
  }
  scan.points_lidar = Court{.height_m = 0.9}.scan();
  EXPECT_TRUE(shows_level_ground(scan)) << "a low lidar";
  scan.points_lidar = Court{}.scan();
  for (Eigen::Vector3f& p : scan.points_lidar) p = leaning(-8.0, 0.0).cast<float>() * p;
  EXPECT_TRUE(shows_level_ground(scan)) << "a cloud that was turned";
  labels.set_mount(Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, 1.7)));
  EXPECT_FALSE(shows_level_ground(scan)) << "what is told is believed";
}

TEST(NetworkSegmenterOfAnUntoldMount, IsUprightWhereNoStanceIsLookedFor) {
  ModelDescription model = test::describe_family(64, 512, 20);
  model.follow_sensor = true;
  model.lidar_height_m = 1.7;
  model.finds_stance = false;
  std::vector<float> heights_m;
  NetworkSegmenter labels(model, std::make_unique<KeepsHeights>(model.statistics, heights_m));
  Scan scan;
  scan.points_lidar = Court{.R_world_lidar = leaning(0.0, 12.0)}.scan();
  const float lowest_m =
      std::ranges::min(scan.points_lidar, {}, [](const Eigen::Vector3f& p) { return p.z(); }).z();
  static_cast<void>(labels.segment(scan));
  EXPECT_NEAR(heights_m.front(), lowest_m, 0.1F);
  scan.points_lidar = Court{.height_m = 0.9}.scan();
  static_cast<void>(labels.segment(scan));
  EXPECT_NEAR(heights_m[heights_m.size() / 3], -0.9F, 0.1F);
  // A lean that is told counts.
  scan.points_lidar = Court{.R_world_lidar = leaning(0.0, 12.0)}.scan();
  labels.set_mount(Eigen::Isometry3d(leaning(0.0, 12.0)));
  static_cast<void>(labels.segment(scan));
  EXPECT_NEAR(heights_m[heights_m.size() / 3], -1.7F, 0.1F);
}

}  // namespace
}  // namespace stillmap
