#include "core/picture/map_change_picture.hpp"

#include <algorithm>
#include <array>
#include <opencv2/core.hpp>
#include <string>

#include "core/picture/map_canvas.hpp"

namespace stillmap {
namespace {

const cv::Scalar stayed_colour(105, 100, 95);

struct ChangeStyle {
  VoxelChange change;
  const char* text;
  cv::Scalar colour;
};

/// In the order in which they are painted: what is rarer in most maps comes last.
std::array<ChangeStyle, 3> change_styles() {
  return {{{VoxelChange::relabelled, "another class", {40, 210, 240}},
           {VoxelChange::gone, "gone", {60, 60, 235}},
           {VoxelChange::appeared, "appeared", {80, 215, 60}}}};
}

void paint_map(cv::Mat& picture, const PictureFrame& frame, const MapSnapshot& view) {
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      draw_voxel_square(picture, frame, voxel.mean_map, view.voxel_size_m, 1.0, stayed_colour);
    }
  }
}

std::uint64_t count(const DifferenceCounts& counts, VoxelChange change) {
  switch (change) {
    case VoxelChange::appeared:
      return counts.appeared;
    case VoxelChange::gone:
      return counts.gone;
    case VoxelChange::relabelled:
      return counts.relabelled;
  }
  return 0;
}

void paint_changes(cv::Mat& picture, const PictureFrame& frame, const MapDiff& diff,
                   double voxel_size_m) {
  // A single voxel must be found on the picture of a whole town.
  constexpr double min_px = 2.0;
  for (const ChangeStyle& style : change_styles()) {
    for (const VoxelDifference& voxel : diff.voxels) {
      if (voxel.change != style.change) continue;
      draw_voxel_square(picture, frame, voxel.position_map, voxel_size_m, min_px, style.colour);
    }
  }
}

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

void write_diff_picture(const std::filesystem::path& file, const MapSnapshot& before,
                        const MapSnapshot& after, const MapDiff& diff, int max_side_px) {
  Eigen::AlignedBox2d box = xy_bounds(before).merged(xy_bounds(after));
  if (box.isEmpty()) box.extend(Eigen::Vector2d::Zero());
  const PictureFrame frame = fit_frame(box, max_side_px);
  cv::Mat picture(frame.size, CV_8UC3, background());
  paint_map(picture, frame, before);
  paint_map(picture, frame, after);
  const MapSnapshot& filled = before.tiles.empty() ? after : before;
  paint_changes(picture, frame, diff, filled.voxel_size_m);
  draw_scale_bar(picture, frame.px_per_m);

  std::vector<LegendEntry> entries{{"as before", stayed_colour}};
  for (const ChangeStyle& style : change_styles()) {
    const std::string voxels = std::to_string(count(diff.counts, style.change));
    entries.push_back({std::string(style.text) + ": " + voxels, style.colour});
  }
  const std::string title = diff.counts.sum() == 0 ? "Nothing changed." : "What changed, in voxels";
  cv::vconcat(picture, draw_legend(picture.cols, title, entries), picture);
  write_png(file, picture);
}

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
