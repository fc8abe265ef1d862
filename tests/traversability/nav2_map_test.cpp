#include "core/traversability/nav2_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "tests/file_size_limit.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using ::testing::HasSubstr;

OccupancyGrid small_grid() {
  OccupancyGrid grid;
  grid.origin_map = {-3.5, 12.25};
  grid.resolution_m = 0.25;
  grid.width = 3;
  grid.height = 2;
  grid.data = {0, 100, -1, 42, 99, 98};
  return grid;
}

double value_of(const std::string& yaml, const std::string& field) {
  const std::size_t at = yaml.find(field + ": ");
  return at == std::string::npos ? -1.0 : std::stod(yaml.substr(at + field.size() + 2));
}

/// What Nav2's map_server makes of a pixel in trinary mode.
int as_map_server_reads(std::uint8_t shade, const std::string& yaml) {
  const double occupied = (255.0 - shade) / 255.0;
  if (occupied > value_of(yaml, "occupied_thresh")) return 100;
  return occupied < value_of(yaml, "free_thresh") ? 0 : -1;
}

TEST(Nav2Map, MapServerReadsBackWhatIsFreeLethalAndUnknown) {
  const ScratchFolder folder;
  write_nav2_map(folder / "nav2", small_grid());
  const std::string yaml = content_of(folder / "nav2/map.yaml");
  const cv::Mat1b image = cv::imread((folder / "nav2/map.pgm").string(), cv::IMREAD_GRAYSCALE);
  ASSERT_EQ(image.size(), cv::Size(3, 2));
  const auto read = [&](int x, int y) { return as_map_server_reads(image(1 - y, x), yaml); };
  EXPECT_EQ(read(0, 0), 0);
  EXPECT_EQ(read(1, 0), 100);
  EXPECT_EQ(read(2, 0), -1);
  EXPECT_EQ(read(0, 1), 0);
  EXPECT_EQ(read(1, 1), 0);  // the safety margin is the reader's own
  EXPECT_EQ(read(2, 1), 0);
}

TEST(Nav2Map, DescriptionHasWhatMapServerAsksFor) {
  const ScratchFolder folder;
  write_nav2_map(folder.path(), small_grid());
  const std::string yaml = content_of(folder / "map.yaml");
  EXPECT_THAT(yaml, HasSubstr("image: map.pgm"));
  EXPECT_THAT(yaml, HasSubstr("mode: trinary"));
  EXPECT_THAT(yaml, HasSubstr("origin: [-3.500000, 12.250000, 0]"));
  EXPECT_THAT(yaml, HasSubstr("negate: 0"));
  EXPECT_DOUBLE_EQ(value_of(yaml, "resolution"), 0.25);
}

TEST(Nav2Map, OneThatFindsNoRoomLeavesTheOneBeforeIt) {
  const ScratchFolder folder;
  write_nav2_map(folder.path(), small_grid());
  const std::string image = content_of(folder / "map.pgm");
  const std::string yaml = content_of(folder / "map.yaml");
  OccupancyGrid other = small_grid();
  other.origin_map.x() += 1.0;
  other.data.front() = occupancy_lethal;
  {
    // Enough for the image, not for its description.
    const FileSizeLimit limit(image.size());
    EXPECT_THROW(write_nav2_map(folder.path(), other), std::runtime_error);
  }
  EXPECT_EQ(content_of(folder / "map.pgm"), image);
  EXPECT_EQ(content_of(folder / "map.yaml"), yaml);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 2);
}

TEST(Nav2Map, SaysWhyNothingCanBeWritten) {
  OccupancyGrid none;
  none.status = TraversabilityStatus::not_found;
  none.reason = "the map is empty";
  const ScratchFolder folder;
  EXPECT_THAT(message_of<std::invalid_argument>([&] { write_nav2_map(folder.path(), none); }),
              HasSubstr("the map is empty"));
  EXPECT_THAT(message_of<std::runtime_error>([] { write_nav2_map("/dev/null/x", small_grid()); }),
              HasSubstr("/dev/null/x"));
}

}  // namespace
}  // namespace stillmap
