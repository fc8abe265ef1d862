#include "core/picture/traversability_picture.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <stdexcept>

#include "core/picture/map_canvas.hpp"
#include "core/traversability/traversability_query.hpp"

namespace stillmap {
namespace {

const cv::Scalar trajectory_colour(255, 255, 255);
const cv::Scalar path_colour(255, 210, 60);
const cv::Vec3f free_colour(96, 176, 66);
const cv::Vec3f costly_colour(140, 205, 190);
const cv::Vec3f inferred_colour(178, 160, 40);
const cv::Vec3f unknown_in_tile(52, 44, 38);

/// BGR, by BlockReason.
const std::array<cv::Vec3f, block_reason_count>& reason_colours() {
  static const std::array<cv::Vec3f, block_reason_count> colours{
      cv::Vec3f(0, 0, 0),       cv::Vec3f(50, 50, 215),  cv::Vec3f(225, 110, 50),
      cv::Vec3f(30, 150, 255),  cv::Vec3f(190, 70, 150), cv::Vec3f(60, 95, 140),
      cv::Vec3f(165, 135, 185), cv::Vec3f(80, 85, 110),  cv::Vec3f(52, 44, 38)};
  return colours;
}

cv::Vec3f colour_of(const TraversabilityCell& cell) {
  if (cell.state == CellState::unknown) return unknown_in_tile;
  if (cell.state == CellState::lethal) {
    return reason_colours().at(static_cast<std::size_t>(cell.reason));
  }
  const float share = static_cast<float>(cell.cost) / 98.0F;
  return (cell.inferred ? inferred_colour : free_colour) * (1.0F - share) + costly_colour * share;
}

cv::Scalar scalar(const cv::Vec3f& colour) { return {colour[0], colour[1], colour[2]}; }

PictureFrame fit(const TraversabilityView& view, const TraversabilityPictureOptions& options) {
  constexpr double min_width_px = 900.0;
  constexpr double min_height_px = 200.0;
  constexpr double max_px_per_m = 25.0;
  Eigen::AlignedBox2d box = view.bounds_map();
  if (box.isEmpty()) box.extend(Eigen::Vector2d::Zero());
  PictureFrame frame;
  const double longest_m = std::max(1.0, box.sizes().maxCoeff());
  frame.px_per_m = std::min(max_px_per_m, options.max_side_px / longest_m);
  const Eigen::Vector2d size_px =
      (box.sizes() * frame.px_per_m).cwiseMax(Eigen::Vector2d(min_width_px, min_height_px));
  frame.size = {cvCeil(size_px.x()), cvCeil(size_px.y())};
  frame.corner_map = box.center() - size_px / (2.0 * frame.px_per_m);
  return frame;
}

void draw_cells(cv::Mat3b& picture, const PictureFrame& frame, const TraversabilityView& view) {
  CellLookup lookup(view);
  const Eigen::AlignedBox2d bounds_map = view.bounds_map();
  for (int row = 0; row < picture.rows; ++row) {
    for (int column = 0; column < picture.cols; ++column) {
      const Eigen::Vector2d p_map =
          frame.corner_map +
          Eigen::Vector2d(column + 0.5, picture.rows - row - 0.5) / frame.px_per_m;
      if (!bounds_map.contains(p_map)) continue;
      const std::optional<CellIndex> cell = view.cell_of(p_map);
      if (cell) picture(row, column) = cv::Vec3b(colour_of(lookup.at(*cell).cell));
    }
  }
}

void draw_path(cv::Mat& picture, const PictureFrame& frame, std::span<const PlanarPose> path_map) {
  Trajectory line;
  for (const PlanarPose& pose : path_map) {
    StampedPose stamped;
    stamped.T_map_lidar = Eigen::Isometry3d::Identity();
    stamped.T_map_lidar.translation() << pose.position_map, 0.0;
    line.push_back(stamped);
  }
  draw_trajectory(picture, frame, line, path_colour);
  draw_ends(picture, frame, line);
}

std::string square_metres(std::uint64_t cells, double cell_m) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(0) << static_cast<double>(cells) * cell_m * cell_m
       << " m2";
  return text.str();
}

std::string title(const TraversabilityView& view, const TraversabilitySummary& summary) {
  if (view.tiles.empty()) return "The map is empty.";
  std::ostringstream text;
  text << "Traversable for '" << view.profile.name
       << "': " << square_metres(summary.free, view.cell_m) << " free, "
       << square_metres(summary.all_lethal(), view.cell_m) << " lethal; cells of " << view.cell_m
       << " m";
  return text.str();
}

std::vector<LegendEntry> legend_of(const TraversabilityView& view,
                                   const TraversabilitySummary& summary,
                                   const TraversabilityPictureOptions& options) {
  std::vector<LegendEntry> entries{
      {"free", scalar(free_colour)},
      {"free at a cost", scalar(costly_colour)},
      {"free, inferred " + square_metres(summary.inferred, view.cell_m), scalar(inferred_colour)}};
  for (std::size_t i = 0; i < block_reason_count; ++i) {
    if (summary.lethal.at(i) == 0) continue;
    entries.push_back({std::string(name(static_cast<BlockReason>(i))) + " " +
                           square_metres(summary.lethal.at(i), view.cell_m),
                       scalar(reason_colours().at(i))});
  }
  entries.push_back({"unknown", scalar(unknown_in_tile)});
  if (!options.trajectory.empty()) entries.push_back({"trajectory", trajectory_colour});
  if (!options.path_map.empty()) entries.push_back({"path", path_colour});
  return entries;
}

}  // namespace

void write_traversability_picture(const std::filesystem::path& file, const TraversabilityView& view,
                                  const TraversabilityPictureOptions& options) {
  const PictureFrame frame = fit(view, options);
  cv::Mat3b area(frame.size);
  area.setTo(background());
  draw_cells(area, frame, view);
  cv::Mat picture = area;
  if (!options.trajectory.empty()) {
    draw_trajectory(picture, frame, options.trajectory, trajectory_colour);
    draw_ends(picture, frame, options.trajectory);
  }
  if (!options.path_map.empty()) draw_path(picture, frame, options.path_map);
  draw_scale_bar(picture, frame.px_per_m);
  const TraversabilitySummary summary = summarize(view);
  cv::vconcat(picture,
              draw_legend(picture.cols, title(view, summary), legend_of(view, summary, options)),
              picture);
  write_png(file, picture);
}

}  // namespace stillmap
