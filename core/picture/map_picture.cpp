#include "core/picture/map_picture.hpp"

#include <algorithm>
#include <array>
#include <iomanip>
#include <opencv2/core.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "core/picture/picture_overlay.hpp"
#include "core/picture/picture_raster.hpp"
#include "core/picture/png_file.hpp"

namespace stillmap {
namespace {

const cv::Scalar estimate_colour(255, 255, 255);
const cv::Scalar truth_colour(255, 210, 60);

Eigen::AlignedBox2d extent(const MapSnapshot& view, const Trajectory& estimate,
                           const MapPictureOptions& options) {
  Eigen::AlignedBox2d box = xy_bounds(view);
  const auto extend_by = [&box](const Trajectory& trajectory) {
    for (const StampedPose& pose : trajectory) {
      const Eigen::Vector2d p = pose.T_map_lidar.translation().head<2>();
      if (p.allFinite()) box.extend(p);
    }
  };
  extend_by(estimate);
  if (options.truth) extend_by(*options.truth);
  if (box.isEmpty()) box.extend(Eigen::Vector2d::Zero());
  return box;
}

double length_m(const Trajectory& trajectory) {
  double length = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    length +=
        (trajectory[i].T_map_lidar.translation() - trajectory[i - 1].T_map_lidar.translation())
            .norm();
  }
  return length;
}

std::string with_thousands(std::size_t number) {
  const std::string digits = std::to_string(number);
  std::string grouped;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) grouped.push_back(',');
    grouped.push_back(digits[i]);
  }
  return grouped;
}

using ClassCounts = std::array<std::size_t, semantic_class_count>;

ClassCounts count_classes(const MapSnapshot& view) {
  ClassCounts counts{};
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      ++counts.at(static_cast<std::size_t>(voxel.evidence.winner()));
    }
  }
  return counts;
}

std::string title(const MapSnapshot& view, const Trajectory& estimate) {
  if (view.tiles.empty()) return "The map is empty.";
  std::size_t voxels = 0;
  for (const auto& tile : view.tiles) voxels += tile->voxels.size();
  std::ostringstream text;
  text << with_thousands(voxels) << " voxels of " << view.voxel_size_m << " m in "
       << view.tiles.size() << " tiles";
  if (!estimate.empty()) {
    text << ", " << std::fixed << std::setprecision(0) << length_m(estimate) << " m driven";
  }
  return text.str();
}

std::vector<LegendEntry> legend_entries(const MapSnapshot& view, const Trajectory& estimate,
                                        const MapPictureOptions& options) {
  std::vector<LegendEntry> entries;
  if (!estimate.empty()) entries.push_back({"trajectory", estimate_colour});
  if (options.truth) entries.push_back({"truth", truth_colour});
  if (options.query_box_map) entries.push_back({"query", query_box_colour()});
  const ClassCounts counts = count_classes(view);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts.at(i) == 0) continue;
    const auto label = static_cast<SemanticClass>(i);
    const bool has_class = label != SemanticClass::unlabeled;
    const cv::Vec3f colour = has_class ? class_colour(label) : height_colour(0.6F);
    entries.push_back({std::string(has_class ? name(label) : "no class (colour by height)"),
                       cv::Scalar(colour[0], colour[1], colour[2])});
  }
  return entries;
}

}  // namespace

void write_map_picture(const std::filesystem::path& file, const MapSnapshot& view,
                       const Trajectory& estimate, const MapPictureOptions& options) {
  const PictureFrame frame = fit_frame(extent(view, estimate, options), options.max_side_px);
  cv::Mat picture = draw_voxels(view, frame);
  if (options.query_box_map) draw_box(picture, frame, *options.query_box_map);
  if (options.truth) draw_trajectory(picture, frame, *options.truth, truth_colour);
  draw_trajectory(picture, frame, estimate, estimate_colour);
  draw_ends(picture, frame, estimate);
  draw_scale_bar(picture, frame.px_per_m);

  cv::vconcat(
      picture,
      draw_legend(picture.cols, title(view, estimate), legend_entries(view, estimate, options)),
      picture);
  write_png(file, picture);
}

}  // namespace stillmap
