#include "core/picture/removed_picture.hpp"

#include <algorithm>
#include <array>
#include <opencv2/core.hpp>
#include <string>

#include "core/picture/picture_frame.hpp"
#include "core/picture/picture_overlay.hpp"
#include "core/picture/picture_raster.hpp"
#include "core/picture/png_file.hpp"

namespace stillmap {
namespace {

const cv::Scalar shown_colour(105, 100, 95);

struct ReasonStyle {
  RemovalReason reason;
  std::string_view text;
  cv::Scalar colour;
};

/// In the order in which they are painted.
const std::array<ReasonStyle, removal_reason_count>& styles() {
  static const std::array<ReasonStyle, removal_reason_count> all{{
      {RemovalReason::moving, "moving", {60, 60, 235}},
      {RemovalReason::semi_static, "semi-static", {235, 150, 60}},
      {RemovalReason::seen_through, "seen through", {80, 215, 60}},
      {RemovalReason::relabelled, "relabelled", {40, 210, 240}},
  }};
  return all;
}

}  // namespace

std::string_view name(RemovalReason reason) {
  return std::ranges::find(styles(), reason, &ReasonStyle::reason)->text;
}

void write_removed_picture(const std::filesystem::path& file, const MapSnapshot& view,
                           const std::vector<RemovedVoxel>& removed, int max_side_px) {
  Eigen::AlignedBox2d box = xy_bounds(view);
  for (const RemovedVoxel& voxel : removed) {
    box.extend(Eigen::Vector2d(voxel.position_map.head<2>().cast<double>()));
  }
  if (box.isEmpty()) box.extend(Eigen::Vector2d(0.0, 0.0));
  const PictureFrame frame = fit_frame(box, max_side_px);
  cv::Mat picture(frame.size, CV_8UC3, background());
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      draw_voxel_square(picture, frame, voxel.mean_map, view.voxel_size_m, 1.0, shown_colour);
    }
  }
  std::vector<LegendEntry> entries{{"static map", shown_colour}};
  for (const ReasonStyle& style : styles()) {
    for (const RemovedVoxel& voxel : removed) {
      if (voxel.reason != style.reason) continue;
      // A single voxel must be found on the picture of a whole town.
      draw_voxel_square(picture, frame, voxel.position_map, view.voxel_size_m, 2.0, style.colour);
    }
    const auto count = std::ranges::count(removed, style.reason, &RemovedVoxel::reason);
    entries.push_back({std::string(style.text) + ": " + std::to_string(count), style.colour});
  }
  draw_scale_bar(picture, frame.px_per_m);
  cv::vconcat(picture, draw_legend(picture.cols, "Removed from the static map, in voxels", entries),
              picture);
  write_png(file, picture);
}

}  // namespace stillmap
