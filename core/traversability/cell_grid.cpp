#include "core/traversability/cell_grid.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace stillmap {

CellGrid<float> distances_to_marked(const CellGrid<std::uint8_t>& marked, double max_distance,
                                    const std::function<void()>& each_block) {
  assert(max_distance > 0.0 && max_distance <= 1024.0);
  CellGrid<float> distances(marked.width(), marked.height());
  if (marked.cells().empty()) return distances;
  // OpenCV measures the distance to the nearest zero.
  cv::Mat1b open(marked.height(), marked.width());
  std::ranges::transform(marked.cells(), open.begin(),
                         [](std::uint8_t mark) { return static_cast<std::uint8_t>(mark == 0); });
  cv::Mat1f result(marked.height(), marked.width(), &distances(0, 0));
  // OpenCV adds squares of cell numbers and of distances in floats, which are exact below 2^24, and
  // its table of squares overflows beyond 46340 rows: larger grids are cut into blocks of at most
  // 3072 cells a side that overlap by the largest distance.
  constexpr int block_cells = 1024;
  const int overlap = static_cast<int>(std::ceil(max_distance));
  const cv::Rect grid(0, 0, open.cols, open.rows);
  for (int y = 0; y < grid.height; y += block_cells) {
    for (int x = 0; x < grid.width; x += block_cells) {
      if (each_block) each_block();
      const cv::Rect block = cv::Rect(x, y, block_cells, block_cells) & grid;
      const cv::Rect wide = cv::Rect(block.tl() - cv::Point(overlap, overlap),
                                     block.size() + cv::Size(2 * overlap, 2 * overlap)) &
                            grid;
      cv::Mat1f wide_distances;
      cv::distanceTransform(open(wide), wide_distances, cv::DIST_L2, cv::DIST_MASK_PRECISE);
      // Also where nothing is marked: OpenCV's value there has no meaning.
      cv::min(wide_distances(block - wide.tl()), max_distance, result(block));
    }
  }
  return distances;
}

}  // namespace stillmap
