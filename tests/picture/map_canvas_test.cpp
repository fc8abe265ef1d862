#include "core/picture/map_canvas.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "tests/file_size_limit.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

cv::Mat3b colourful(int rows, int columns) {
  cv::Mat3b picture(rows, columns);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      picture(r, c) = cv::Vec3b(static_cast<std::uint8_t>(r), static_cast<std::uint8_t>(3 * c),
                                static_cast<std::uint8_t>(r * c));
    }
  }
  return picture;
}

std::string refusal(const std::filesystem::path& file) {
  try {
    write_png(file, colourful(2, 2));
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return {};
}

TEST(MapCanvas, PictureThatFindsNoRoomLeavesTheOneBeforeIt) {
  const ScratchFolder folder;
  write_png(folder / "a.png", colourful(3, 3));
  const std::string before = content_of(folder / "a.png");
  {
    const FileSizeLimit limit(200);
    EXPECT_THROW(write_png(folder / "a.png", colourful(200, 200)), std::runtime_error);
  }
  EXPECT_EQ(content_of(folder / "a.png"), before);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(MapCanvas, HoldsEveryPixelAsAnotherReaderSeesIt) {
  const ScratchFolder folder;
  const cv::Mat3b picture = colourful(37, 91);
  write_png(folder / "a.png", picture);
  const cv::Mat3b read = cv::imread((folder / "a.png").string());
  ASSERT_EQ(read.size(), picture.size());
  EXPECT_EQ(cv::norm(read, picture, cv::NORM_INF), 0.0);
}

TEST(MapCanvas, WritesAPartOfALargerPicture) {
  const ScratchFolder folder;
  const cv::Mat3b part = colourful(40, 50)(cv::Rect(7, 5, 20, 30));
  ASSERT_FALSE(part.isContinuous());
  write_png(folder / "part.png", part);
  const cv::Mat3b read = cv::imread((folder / "part.png").string());
  ASSERT_EQ(read.size(), part.size());
  EXPECT_EQ(cv::norm(read, part, cv::NORM_INF), 0.0);
}

TEST(MapCanvas, NamesTheFileThatItCannotWrite) {
  const ScratchFolder folder;
  for (const auto& file : {folder / "no" / "a.png", folder / "a.jpg", folder / "png"}) {
    EXPECT_THAT(refusal(file), testing::HasSubstr(file.string()));
    EXPECT_FALSE(std::filesystem::exists(file));
  }
}

}  // namespace
}  // namespace stillmap
