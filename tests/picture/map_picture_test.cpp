#include "core/picture/map_picture.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <opencv2/imgcodecs.hpp>

#include "tests/map/map_worlds.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

Trajectory drive(int poses) {
  Trajectory trajectory;
  for (int i = 0; i < poses; ++i) {
    trajectory.push_back({i, Eigen::Isometry3d(Eigen::Translation3d(i, 0.1 * i, 0.0))});
  }
  return trajectory;
}

/// Pixels of exactly this colour (BGR).
int count_pixels(const cv::Mat& picture, const cv::Vec3b& bgr) {
  cv::Mat1b is_equal;
  cv::inRange(picture, bgr, bgr, is_equal);
  return cv::countNonZero(is_equal);
}

TEST(MapPicture, ShowsTheMapTheDriveAndTheBoxAtASensibleSize) {
  const ScratchFolder folder;
  const auto view = test::street_map(5, 300).view();
  MapPictureOptions options;
  options.max_side_px = 900;
  write_map_picture(folder / "plain.png", *view, {}, options);
  const cv::Mat plain = cv::imread((folder / "plain.png").string());
  EXPECT_EQ(plain.cols, 900);
  EXPECT_LE(plain.rows, 1000);
  const cv::Vec3b box_colour(40, 140, 255);
  EXPECT_EQ(count_pixels(plain, box_colour), 0);

  options.truth = drive(30);
  const double infinity = std::numeric_limits<double>::infinity();
  options.query_box_map = Eigen::AlignedBox3d(Eigen::Vector3d(-10, -infinity, -infinity),
                                              Eigen::Vector3d(10, infinity, infinity));
  write_map_picture(folder / "full.png", *view, drive(20), options);
  const cv::Mat full = cv::imread((folder / "full.png").string());
  EXPECT_GT(count_pixels(full, box_colour), 1000);
  EXPECT_GT(count_pixels(full, {255, 210, 60}), 20) << "truth";
}

TEST(MapPicture, EmptyMapStillGivesAPicture) {
  const ScratchFolder folder;
  write_map_picture(folder / "empty.png", MapSnapshot{}, {});
  EXPECT_FALSE(cv::imread((folder / "empty.png").string()).empty());
}

TEST(MapPicture, PosesThatAreNoNumbersDoNoHarm) {
  const ScratchFolder folder;
  Trajectory trajectory = drive(3);
  trajectory[1].T_map_lidar.translation().x() = std::numeric_limits<double>::quiet_NaN();
  write_map_picture(folder / "nan.png", MapSnapshot{}, trajectory);
  EXPECT_FALSE(cv::imread((folder / "nan.png").string()).empty());
}

TEST(MapPicture, PlacesThatWereFoundOneByOneAreNoDrive) {
  const ScratchFolder folder;
  const auto view = test::street_map(5, 300).view();
  Trajectory places = drive(3);
  for (StampedPose& place : places) place.T_map_lidar.translation() *= 20.0;
  const auto white = [&](const MapPictureOptions& options) {
    write_map_picture(folder / "map.png", *view, places, options);
    return count_pixels(cv::imread((folder / "map.png").string()), {255, 255, 255});
  };
  const int of_drive = white({});
  MapPictureOptions options;
  options.looked_for = 4;
  const int of_places = white(options);
  EXPECT_GT(of_places, 3 * 50) << "a disc each";
  EXPECT_LT(of_places, of_drive) << "no line joins them";
  places[1].T_map_lidar.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_LT(white(options), of_places);
}

TEST(MapPicture, FileThatCannotBeWrittenIsNamed) {
  const ScratchFolder folder;
  EXPECT_THAT([&] { write_map_picture(folder / "no" / "map.png", MapSnapshot{}, {}); },
              testing::ThrowsMessage<std::runtime_error>(testing::HasSubstr("no/map.png")));
  EXPECT_THROW(write_map_picture(folder / "map.unknown", MapSnapshot{}, {}), std::runtime_error);
}

}  // namespace
}  // namespace stillmap
