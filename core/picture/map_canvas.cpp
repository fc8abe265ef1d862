#include "core/picture/map_canvas.hpp"

#include <png.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <stdexcept>
#include <string>

#include "core/process/file_beside.hpp"

namespace stillmap {
namespace {

/// Sub-pixel bits of OpenCV's drawing functions.
constexpr int shift = 4;
constexpr int font = cv::FONT_HERSHEY_SIMPLEX;
constexpr double font_scale = 0.5;
const cv::Scalar white(245, 245, 245);
const cv::Scalar black(0, 0, 0);

cv::Point fixed_point(const cv::Point2d& pixel) {
  // Far outside is as good as outside, and stays within int.
  constexpr double limit = 1e6;
  return {cvRound(std::clamp(pixel.x, -limit, limit) * (1 << shift)),
          cvRound(std::clamp(pixel.y, -limit, limit) * (1 << shift))};
}

cv::Point fixed_point(const PictureFrame& frame, const StampedPose& pose) {
  return fixed_point(frame.pixel(pose.T_map_lidar.translation().head<2>()));
}

void put_text(cv::Mat& picture, const std::string& text, const cv::Point& at,
              const cv::Scalar& colour) {
  cv::putText(picture, text, at, font, font_scale, colour, 1, cv::LINE_AA);
}

int text_width(const std::string& text) {
  int baseline = 0;
  return cv::getTextSize(text, font, font_scale, 1, &baseline).width;
}

double round_length(double max_length_m) {
  const double power = std::pow(10.0, std::floor(std::log10(max_length_m)));
  for (const double factor : {5.0, 2.0}) {
    if (factor * power <= max_length_m) return factor * power;
  }
  return power;
}

bool write_bgr(const std::filesystem::path& file, const cv::Mat& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(picture.cols);
  image.height = static_cast<png_uint_32>(picture.rows);
  image.format = PNG_FORMAT_BGR;
  image.flags = PNG_IMAGE_FLAG_FAST;
  const auto row_bytes = static_cast<png_int_32>(picture.step[0]);
  return png_image_write_to_file(&image, file.c_str(), 0, picture.data, row_bytes, nullptr) != 0;
}

}  // namespace

Eigen::AlignedBox2d xy_bounds(const MapSnapshot& view) {
  Eigen::AlignedBox2d box;
  for (const auto& tile : view.tiles) {
    box.extend(tile->info.bounds_map.min().head<2>().cast<double>());
    box.extend(tile->info.bounds_map.max().head<2>().cast<double>());
  }
  return box;
}

PictureFrame fit_frame(const Eigen::AlignedBox2d& box_map, int max_side_px) {
  constexpr double margin_m = 4.0;
  constexpr double max_px_per_m = 15.0;
  const Eigen::Vector2d size_m = box_map.sizes() + Eigen::Vector2d::Constant(2.0 * margin_m);
  PictureFrame frame;
  frame.px_per_m = std::min(max_px_per_m, max_side_px / size_m.maxCoeff());
  // The legend needs some width; a narrow map stands in its middle.
  const Eigen::Vector2d size_px = (size_m * frame.px_per_m).cwiseMax(Eigen::Vector2d(640.0, 200.0));
  frame.size = {cvCeil(size_px.x()), cvCeil(size_px.y())};
  frame.corner_map = box_map.center() - size_px / (2.0 * frame.px_per_m);
  return frame;
}

cv::Scalar background() { return {30, 24, 20}; }

cv::Scalar query_box_colour() { return {40, 140, 255}; }

void draw_trajectory(cv::Mat& picture, const PictureFrame& frame, const Trajectory& trajectory,
                     const cv::Scalar& colour) {
  std::vector<cv::Point> line;
  for (const StampedPose& pose : trajectory) line.push_back(fixed_point(frame, pose));
  // A dark casing first: the line stays visible on every class colour.
  cv::polylines(picture, line, false, black, 6, cv::LINE_AA, shift);
  cv::polylines(picture, line, false, colour, 2, cv::LINE_AA, shift);
}

void draw_ends(cv::Mat& picture, const PictureFrame& frame, const Trajectory& trajectory) {
  if (trajectory.empty()) return;
  const cv::Point start = fixed_point(frame, trajectory.front());
  const cv::Point end = fixed_point(frame, trajectory.back());
  constexpr int radius = 8 << shift;
  cv::circle(picture, start, radius, black, 6, cv::LINE_AA, shift);
  cv::circle(picture, start, radius, white, 2, cv::LINE_AA, shift);
  cv::circle(picture, end, radius + (2 << shift), black, cv::FILLED, cv::LINE_AA, shift);
  cv::circle(picture, end, radius, white, cv::FILLED, cv::LINE_AA, shift);
}

void draw_box(cv::Mat& picture, const PictureFrame& frame, const Eigen::AlignedBox3d& box_map) {
  const auto inside = [&](const cv::Point2d& p) {
    return cv::Point2d(std::clamp(p.x, 2.0, picture.cols - 3.0),
                       std::clamp(p.y, 2.0, picture.rows - 3.0));
  };
  const cv::Point low = fixed_point(inside(frame.pixel(box_map.min().head<2>())));
  const cv::Point high = fixed_point(inside(frame.pixel(box_map.max().head<2>())));
  cv::rectangle(picture, low, high, black, 4, cv::LINE_AA, shift);
  cv::rectangle(picture, low, high, query_box_colour(), 2, cv::LINE_AA, shift);
}

void draw_voxel_square(cv::Mat& picture, const PictureFrame& frame, const Eigen::Vector3f& p_map,
                       double voxel_size_m, double min_px, const cv::Scalar& colour) {
  const cv::Point2d centre = frame.pixel(p_map.head<2>().cast<double>());
  const double half = std::max(voxel_size_m * frame.px_per_m, min_px) / 2.0;
  cv::rectangle(picture, cv::Point2d(centre.x - half, centre.y - half),
                cv::Point2d(centre.x + half, centre.y + half), colour, cv::FILLED);
}

void draw_scale_bar(cv::Mat& picture, double px_per_m) {
  const double length_m = round_length(picture.cols / px_per_m / 4.0);
  std::ostringstream text;
  text << length_m << " m";
  const cv::Point left(20, picture.rows - 20);
  const cv::Point right(left.x + cvRound(length_m * px_per_m), left.y);
  const cv::Point tick(0, 6);
  for (const auto& [colour, thickness] : {std::pair(black, 5), std::pair(white, 2)}) {
    cv::line(picture, left, right, colour, thickness, cv::LINE_AA);
    cv::line(picture, left - tick, left + tick, colour, thickness, cv::LINE_AA);
    cv::line(picture, right - tick, right + tick, colour, thickness, cv::LINE_AA);
    cv::putText(picture, text.str(), left + cv::Point(8, -10), font, 0.6, colour, thickness - 1,
                cv::LINE_AA);
  }
}

cv::Mat draw_legend(int width_px, const std::string& title,
                    const std::vector<LegendEntry>& entries) {
  constexpr int margin = 20;
  constexpr int row_height = 26;
  constexpr int swatch = 14;
  std::vector<cv::Point> places;
  cv::Point at(margin, 28 + row_height);
  for (const LegendEntry& entry : entries) {
    const int width = swatch + 8 + text_width(entry.text) + 24;
    if (at.x > margin && at.x + width > width_px) at = {margin, at.y + row_height};
    places.push_back(at);
    at.x += width;
  }
  cv::Mat strip(at.y + margin, width_px, CV_8UC3, background() * 1.5);
  put_text(strip, title, {margin, 28}, white);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const cv::Point corner = places[i] - cv::Point(0, swatch - 2);
    cv::rectangle(strip, {corner, cv::Size(swatch, swatch)}, entries[i].colour, cv::FILLED);
    put_text(strip, entries[i].text, places[i] + cv::Point(swatch + 8, 0), {210, 210, 210});
  }
  return strip;
}

void write_png(const std::filesystem::path& file, const cv::Mat& picture) {
  assert(picture.type() == CV_8UC3);
  if (file.extension() == ".png") {
    FileBeside beside(file);
    if (write_bgr(beside.path(), picture) && !beside.put_in_place()) return;
  }
  throw std::runtime_error(file.string() +
                           ": the picture cannot be written; its folder must exist and be "
                           "writable, its name end in .png");
}

}  // namespace stillmap
