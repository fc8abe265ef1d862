#include "core/picture/map_change_picture.hpp"

#include <array>
#include <opencv2/core.hpp>
#include <string>

#include "core/picture/map_canvas.hpp"

namespace stillmap {
namespace {

const cv::Scalar unchanged_colour(105, 100, 95);

struct ChangeStyle {
  VoxelChange change;
  const char* text;
  cv::Scalar colour;
  std::uint64_t DifferenceCounts::*count;
};

/// In the order in which they are painted: what is rarer in most maps comes last.
const std::array<ChangeStyle, 3> change_styles{
    {{VoxelChange::relabelled, "another class", {40, 210, 240}, &DifferenceCounts::relabelled},
     {VoxelChange::gone, "gone", {60, 60, 235}, &DifferenceCounts::gone},
     {VoxelChange::appeared, "appeared", {80, 215, 60}, &DifferenceCounts::appeared}}};

struct ReasonStyle {
  RemovalReason reason;
  cv::Scalar colour;
};

/// In the order in which they are painted.
const std::array<ReasonStyle, removal_reason_count> reason_styles{
    {{RemovalReason::moving, {60, 60, 235}},
     {RemovalReason::semi_static, {235, 150, 60}},
     {RemovalReason::seen_through, {80, 215, 60}},
     {RemovalReason::relabelled, {40, 210, 240}}}};

void paint_map(cv::Mat& picture, const PictureFrame& frame, const MapSnapshot& view) {
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      draw_voxel_square(picture, frame, voxel.mean_map, view.voxel_size_m, 1.0, unchanged_colour);
    }
  }
}

/// At least 2 pixels wide: a single voxel must be visible on the picture of a whole town.
void paint_voxel(cv::Mat& picture, const PictureFrame& frame, const Eigen::Vector3f& position_map,
                 double voxel_size_m, const cv::Scalar& colour) {
  draw_voxel_square(picture, frame, position_map, voxel_size_m, 2.0, colour);
}

void finish(const std::filesystem::path& file, cv::Mat picture, const PictureFrame& frame,
            const std::string& title, const std::vector<LegendEntry>& entries) {
  draw_scale_bar(picture, frame.px_per_m);
  cv::vconcat(picture, draw_legend(picture.cols, title, entries), picture);
  write_png(file, picture);
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
  const double voxel_size_m = (before.tiles.empty() ? after : before).voxel_size_m;
  std::vector<LegendEntry> entries{{"as before", unchanged_colour}};
  for (const ChangeStyle& style : change_styles) {
    for (const VoxelDifference& voxel : diff.voxels) {
      if (voxel.change != style.change) continue;
      paint_voxel(picture, frame, voxel.position_map, voxel_size_m, style.colour);
    }
    entries.push_back(
        {std::string(style.text) + ": " + std::to_string(diff.counts.*style.count), style.colour});
  }
  finish(file, picture, frame,
         diff.counts.sum() == 0 ? "Nothing changed." : "What changed, in voxels", entries);
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
  paint_map(picture, frame, view);
  std::vector<LegendEntry> entries{{"static map", unchanged_colour}};
  for (const ReasonStyle& style : reason_styles) {
    std::size_t count = 0;
    for (const RemovedVoxel& voxel : removed) {
      if (voxel.reason != style.reason) continue;
      paint_voxel(picture, frame, voxel.position_map, view.voxel_size_m, style.colour);
      ++count;
    }
    entries.push_back(
        {std::string(name(style.reason)) + ": " + std::to_string(count), style.colour});
  }
  finish(file, picture, frame, "Removed from the static map, in voxels", entries);
}

}  // namespace stillmap
