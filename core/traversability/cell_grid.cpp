#include "core/traversability/cell_grid.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace stillmap {

CellGrid<float> distances_to_marked(const CellGrid<std::uint8_t>& marked, double max_distance) {
  assert(max_distance > 0.0 && max_distance <= 1024.0);
  CellGrid<float> distances(marked.width(), marked.height());
  if (marked.cells().empty()) return distances;
  // OpenCV measures the distance to the nearest zero.
  cv::Mat1b open(marked.height(), marked.width());
  std::ranges::transform(marked.cells(), open.begin(),
                         [](std::uint8_t mark) { return std::uint8_t{mark == 0 ? 1U : 0U}; });
  cv::Mat1f result(marked.height(), marked.width(), &distances(0, 0));
  // OpenCV adds squares of column numbers and of distances in floats, which are exact below 2^24:
  // wider grids are cut into strips of at most 3072 columns that overlap by the largest distance.
  constexpr int strip_width = 1024;
  const int overlap = static_cast<int>(std::ceil(max_distance));
  for (int begin = 0; begin < open.cols; begin += strip_width) {
    const int end = std::min(begin + strip_width, open.cols);
    const int first = std::max(0, begin - overlap);
    const int last = std::min(end + overlap, open.cols);
    cv::Mat1f strip;
    cv::distanceTransform(open.colRange(first, last), strip, cv::DIST_L2, cv::DIST_MASK_PRECISE);
    // Also where nothing is marked: OpenCV's value there has no meaning.
    cv::min(strip.colRange(begin - first, end - first), max_distance, result.colRange(begin, end));
  }
  return distances;
}

}  // namespace stillmap
