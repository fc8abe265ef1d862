#include "core/picture/traversability_picture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "tests/scratch_folder.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using ::testing::HasSubstr;

cv::Mat3b picture_of(const TraversabilityView& view,
                     const TraversabilityPictureOptions& options = {}) {
  const ScratchFolder folder;
  write_traversability_picture(folder / "area.png", view, options);
  return cv::imread((folder / "area.png").string());
}

bool is_green(const cv::Vec3b& bgr) { return bgr[1] > bgr[0] + 30 && bgr[1] > bgr[2] + 30; }
bool is_red(const cv::Vec3b& bgr) { return bgr[2] > bgr[0] + 100 && bgr[2] > bgr[1] + 100; }

TEST(TraversabilityPicture, FreeIsGreenObstaclesAreRedAndYIsUp) {
  test::VoxelWorld world;
  world.ground(-20, -20, 20, 20, road);
  world.block(-16, 8, -8, 16, 0.3, 2.0, building);  // upper left
  const auto view = test::traversability_of(world.view(), test::square_robot());
  const cv::Mat3b picture = picture_of(*view);
  const double px_per_m = picture.cols / 40.0;
  const auto at = [&](double x_m, double y_m) {
    return picture(static_cast<int>((20.0 - y_m) * px_per_m),
                   static_cast<int>((x_m + 20.0) * px_per_m));
  };
  EXPECT_TRUE(is_red(at(-12, 12)));
  EXPECT_TRUE(is_green(at(12, 12)));
  EXPECT_TRUE(is_green(at(-12, -5)));
}

TEST(TraversabilityPicture, ShowsThePath) {
  test::VoxelWorld world;
  world.ground(-20, -20, 20, 20, road);
  const auto view = test::traversability_of(world.view(), test::square_robot());
  const std::vector<PlanarPose> path{{{-10, 0}, 0}, {{10, 0}, 0}};
  TraversabilityPictureOptions options;
  options.path_map = path;
  const cv::Mat3b picture = picture_of(*view, options);
  const int middle_px = static_cast<int>(20.0 * picture.cols / 40.0);
  EXPECT_FALSE(is_green(picture(middle_px, middle_px)));
}

TEST(TraversabilityPicture, AnEmptyAreaIsAPictureToo) {
  EXPECT_FALSE(picture_of(*test::traversability_of(MapSnapshot{}, test::square_robot())).empty());
}

TEST(TraversabilityPicture, NamesAFileThatCannotBeWritten) {
  const auto view = test::traversability_of(MapSnapshot{}, test::square_robot());
  for (const char* file : {"/dev/null/a.png", "/tmp/area.unknown_ending"}) {
    EXPECT_THAT(message_of<std::runtime_error>([&] { write_traversability_picture(file, *view); }),
                HasSubstr(file));
  }
}

}  // namespace
}  // namespace stillmap
