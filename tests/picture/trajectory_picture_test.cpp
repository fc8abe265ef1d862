#include "core/picture/trajectory_picture.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>
#include <vector>

namespace stillmap {
namespace {

using Positions = std::vector<Eigen::Vector3d>;

class PictureTest : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] bool is_png(const std::string& file_name) const {
    std::ifstream file(folder_ / file_name, std::ios::binary);
    std::string start(8, '\0');
    file.read(start.data(), 8);
    return start == "\x89PNG\r\n\x1a\n";
  }

  std::filesystem::path folder_;
};

TEST_F(PictureTest, ShowsPathsWhateverTheirShape) {
  const Positions line{{0, 0, 0}, {100, 0, 0}};
  const Positions standing{{5, 5, 5}, {5, 5, 5}};
  write_path_picture(folder_ / "line.png", line, line, GroundPlane::xy);
  write_path_picture(folder_ / "standing.png", standing, line, GroundPlane::xz);
  write_path_picture(folder_ / "empty.png", {}, {}, GroundPlane::xy);
  EXPECT_TRUE(is_png("line.png"));
  EXPECT_TRUE(is_png("standing.png"));
  EXPECT_TRUE(is_png("empty.png"));
}

TEST_F(PictureTest, ShowsChartsEvenOfNothing) {
  const std::vector<double> x{0.0, 10.0, 20.0};
  const std::vector<ChartLine> lines{{"error in m", {0.0, 0.1, 0.4}}, {"flat", {0.0, 0.0, 0.0}}};
  write_chart(folder_ / "chart.png", "distance in m", x, lines);
  write_chart(folder_ / "empty.png", "distance in m", {}, {});
  EXPECT_TRUE(is_png("chart.png"));
  EXPECT_TRUE(is_png("empty.png"));
}

TEST_F(PictureTest, NamesTheFileThatCannotBeWritten) {
  for (const char* bad : {"no/such/folder.png", "no_format"}) {
    try {
      write_path_picture(folder_ / bad, {}, {}, GroundPlane::xy);
      FAIL() << bad << " was written";
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find(bad), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace stillmap
