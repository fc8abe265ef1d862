#pragma once

#include <tsl/robin_map.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/lidar/voxel_index.hpp"

namespace stillmap {

/// Sizes of a LayeredCells.
struct LayeredCellsConfig {
  /// Edge of a cell [m].
  double cell_m = 1.0;
  /// Height of a layer [m].
  double layer_m = 2.0;
  /// A point also occupies the cells and layers that are as near as this to it [m].
  double margin_m = 0.35;
};

/// Which layers of which cells of the plane are occupied, for correlative scan matching: eight bits
/// a cell, one a layer; the ninth layer is the first again, so that hills need no datum. Pages of
/// cells are hashed: a road of kilometres takes what lies beside it.
class LayeredCells {
 public:
  explicit LayeredCells(const LayeredCellsConfig& config) : config_(config) {}

  [[nodiscard]] const LayeredCellsConfig& config() const { return config_; }
  void insert(const Eigen::Vector3f& position_map);

  /// Column or row of a coordinate [m].
  [[nodiscard]] int index(double coordinate_m) const {
    return static_cast<int>(std::floor(coordinate_m / config_.cell_m));
  }
  /// The bit of a height [m].
  [[nodiscard]] static std::uint8_t layer_bit(double height_m, double layer_m) {
    return static_cast<std::uint8_t>(
        1U << (static_cast<unsigned>(static_cast<int>(std::floor(height_m / layer_m))) & 7U));
  }

  /// Rows of a rectangle of cells, one after the other; what is not occupied is 0.
  struct Window {
    int first_x = 0;
    int first_y = 0;
    int width = 0;
    int height = 0;
    std::vector<std::uint8_t> cells;
  };
  [[nodiscard]] Window window(int first_x, int first_y, int width, int height) const;

  [[nodiscard]] std::size_t memory_bytes() const { return pages_.capacity() * sizeof(Page); }

 private:
  static constexpr int page_shift = 5;
  static constexpr int page_side = 1 << page_shift;
  using Page = std::array<std::uint8_t, static_cast<std::size_t>(page_side) * page_side>;

  [[nodiscard]] static std::uint64_t key_of(int x, int y) {
    return packed_index(x >> page_shift, y >> page_shift, 0);
  }
  Page& page_at(int x, int y);

  LayeredCellsConfig config_;
  tsl::robin_map<std::uint64_t, std::uint32_t, IndexHash> page_of_;
  std::vector<Page> pages_;
};

}  // namespace stillmap
