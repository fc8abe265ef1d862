#include "core/localization/layered_cells.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace stillmap {
namespace {

const LayeredCellsConfig config{.cell_m = 0.5, .layer_m = 1.0, .margin_m = 0.1};

std::vector<Eigen::Vector3f> random_points(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> place(-40.0F, 40.0F);
  std::vector<Eigen::Vector3f> points(count);
  for (Eigen::Vector3f& p : points) p = {place(random), place(random), 0.2F * place(random)};
  return points;
}

/// Bits of a cell by every point that touches it.
std::uint8_t bits_of(const std::vector<Eigen::Vector3f>& points, int x, int y) {
  std::uint8_t bits = 0;
  for (const Eigen::Vector3f& point : points) {
    const Eigen::Vector3d p = point.cast<double>();
    const auto touches = [&](double coordinate_m, int index) {
      return std::floor((coordinate_m - config.margin_m) / config.cell_m) <= index &&
             index <= std::floor((coordinate_m + config.margin_m) / config.cell_m);
    };
    if (!touches(p.x(), x) || !touches(p.y(), y)) continue;
    for (const double shift_m : {-config.margin_m, 0.0, config.margin_m}) {
      const int layer = static_cast<int>(std::floor((p.z() + shift_m) / config.layer_m));
      bits = static_cast<std::uint8_t>(bits | 1U << static_cast<unsigned>((layer % 8 + 8) % 8));
    }
  }
  return bits;
}

TEST(LayeredCells, WindowIsWhatEveryPointOccupies) {
  const auto points = random_points(300);
  LayeredCells cells(config);
  for (const Eigen::Vector3f& p : points) cells.insert(p);
  const LayeredCells::Window window = cells.window(-70, -33, 101, 77);
  ASSERT_EQ(window.cells.size(), std::size_t{101} * 77);
  for (int y = 0; y < 77; ++y) {
    for (int x = 0; x < 101; ++x) {
      ASSERT_EQ(window.cells[static_cast<std::size_t>(y * 101 + x)],
                bits_of(points, x - 70, y - 33))
          << x << " " << y;
    }
  }
}

TEST(LayeredCells, NothingIsOccupiedWhereNothingIs) {
  LayeredCells cells(config);
  cells.insert({1000.0F, 1000.0F, 0.0F});
  for (const std::uint8_t cell : cells.window(-5, -5, 10, 10).cells) EXPECT_EQ(cell, 0);
}

TEST(LayeredCells, TheNinthLayerIsTheFirstAndBelowZeroTheyGoOn) {
  EXPECT_EQ(LayeredCells::layer_bit(0.5, 1.0), LayeredCells::layer_bit(8.5, 1.0));
  EXPECT_EQ(LayeredCells::layer_bit(-0.5, 1.0), LayeredCells::layer_bit(7.5, 1.0));
  EXPECT_NE(LayeredCells::layer_bit(-0.5, 1.0), LayeredCells::layer_bit(0.5, 1.0));
}

}  // namespace
}  // namespace stillmap
