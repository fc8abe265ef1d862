#include "core/picture/trajectory_picture.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/picture/map_canvas.hpp"

namespace stillmap {
namespace {

constexpr int margin_px = 70;
constexpr double font_size = 0.5;
const cv::Scalar paper(255, 255, 255);
const cv::Scalar ink(60, 60, 60);
const cv::Scalar grid(225, 225, 225);
// Blue, red, green, violet, told apart by colour-blind readers; OpenCV's order is BGR.
const std::array<cv::Scalar, 4> line_colours{cv::Scalar(178, 114, 0), cv::Scalar(0, 94, 213),
                                             cv::Scalar(115, 158, 0), cv::Scalar(167, 121, 204)};

/// Part of a plane that a picture shows, and its scale.
struct Frame {
  cv::Rect2d area;
  double px_per_x = 1.0;
  double px_per_y = 1.0;

  [[nodiscard]] cv::Size size() const {
    return {static_cast<int>(area.width * px_per_x) + 2 * margin_px,
            static_cast<int>(area.height * px_per_y) + 2 * margin_px};
  }
  [[nodiscard]] cv::Point pixel(const cv::Point2d& p) const {
    return {margin_px + static_cast<int>((p.x - area.x) * px_per_x),
            size().height - margin_px - static_cast<int>((p.y - area.y) * px_per_y)};
  }
};

using Line = std::vector<cv::Point2d>;

cv::Rect2d bounds(std::span<const Line> lines) {
  cv::Point2d low(0.0, 0.0), high(1.0, 1.0);
  bool first = true;
  for (const Line& line : lines) {
    for (const cv::Point2d& p : line) {
      if (std::exchange(first, false)) low = high = p;
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
  }
  return {low, high};
}

// 1, 2 or 5 times a power of ten, for about six grid lines.
double grid_step(double extent) {
  const double power = std::pow(10.0, std::floor(std::log10(std::max(extent, 1e-6) / 6.0)));
  const double mantissa = extent / 6.0 / power;
  return power * (mantissa < 1.5 ? 1.0 : mantissa < 3.5 ? 2.0 : mantissa < 7.5 ? 5.0 : 10.0);
}

std::string rounded(double value) {
  std::ostringstream text;
  text << std::setprecision(6) << (std::abs(value) < 1e-9 ? 0.0 : value);
  return text.str();
}

void write_text(cv::Mat& picture, const std::string& text, cv::Point at,
                const cv::Scalar& text_colour) {
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, font_size, text_colour, 1, cv::LINE_AA);
}

void draw_grid(cv::Mat& picture, const Frame& frame) {
  const cv::Rect2d& area = frame.area;
  const double step_x = grid_step(area.width);
  for (double x = std::ceil(area.x / step_x) * step_x; x <= area.br().x; x += step_x) {
    const cv::Point foot = frame.pixel({x, area.y});
    cv::line(picture, foot, frame.pixel({x, area.br().y}), grid);
    write_text(picture, rounded(x), foot + cv::Point(-12, 20), ink);
  }
  const double step_y = grid_step(area.height);
  for (double y = std::ceil(area.y / step_y) * step_y; y <= area.br().y; y += step_y) {
    const cv::Point foot = frame.pixel({area.x, y});
    cv::line(picture, foot, frame.pixel({area.br().x, y}), grid);
    write_text(picture, rounded(y), {4, foot.y + 4}, ink);
  }
}

void draw_line(cv::Mat& picture, const Frame& frame, const Line& line, std::size_t number) {
  std::vector<cv::Point> pixels;
  pixels.reserve(line.size());
  for (const cv::Point2d& p : line) pixels.push_back(frame.pixel(p));
  // The first is broad, so that it can be seen under one that follows it closely.
  cv::polylines(picture, pixels, false, line_colours[number % line_colours.size()],
                number == 0 ? 5 : 2, cv::LINE_AA);
}

// Titles beyond those of the lines are remarks.
void draw_legend(cv::Mat& picture, std::span<const std::string> titles, std::size_t lines) {
  int x = margin_px;
  for (std::size_t i = 0; i < titles.size(); ++i) {
    write_text(picture, titles[i], {x, 30},
               i < lines ? line_colours[i % line_colours.size()] : ink);
    x += cv::getTextSize(titles[i], cv::FONT_HERSHEY_SIMPLEX, font_size, 1, nullptr).width + 30;
  }
}

cv::Mat draw(const Frame& frame, std::span<const Line> lines, std::span<const std::string> titles) {
  cv::Mat picture(frame.size(), CV_8UC3, paper);
  draw_grid(picture, frame);
  for (std::size_t i = 0; i < lines.size(); ++i) draw_line(picture, frame, lines[i], i);
  draw_legend(picture, titles, lines.size());
  return picture;
}

Line flattened(std::span<const Eigen::Vector3d> path, GroundPlane plane) {
  Line line;
  line.reserve(path.size());
  for (const Eigen::Vector3d& p : path) {
    line.emplace_back(p.x(), plane == GroundPlane::xy ? p.y() : p.z());
  }
  return line;
}

}  // namespace

void write_path_picture(const std::filesystem::path& file, std::span<const Eigen::Vector3d> truth,
                        std::span<const Eigen::Vector3d> estimate, GroundPlane plane) {
  const std::array lines{flattened(truth, plane), flattened(estimate, plane)};
  Frame frame{.area = bounds(lines)};
  // A straight path would make a picture without height.
  const double narrowest = std::max({frame.area.width / 3.0, frame.area.height / 3.0, 1.0});
  if (frame.area.width < narrowest) {
    frame.area.x -= (narrowest - frame.area.width) / 2.0;
    frame.area.width = narrowest;
  }
  if (frame.area.height < narrowest) {
    frame.area.y -= (narrowest - frame.area.height) / 2.0;
    frame.area.height = narrowest;
  }
  frame.px_per_x = frame.px_per_y = 900.0 / std::max(frame.area.width, frame.area.height);
  const std::array<std::string, 3> titles{
      "truth", "estimate", plane == GroundPlane::xy ? "(x, y in m)" : "(x, z of the camera in m)"};
  cv::Mat picture = draw(frame, lines, titles);
  if (!lines[0].empty()) cv::circle(picture, frame.pixel(lines[0].front()), 6, ink, 2, cv::LINE_AA);
  write_png(file, picture);
}

void write_chart(const std::filesystem::path& file, const std::string& x_title,
                 std::span<const double> x, std::span<const ChartLine> lines) {
  std::vector<Line> drawn;
  std::vector<std::string> titles;
  for (const ChartLine& line : lines) {
    titles.push_back(line.title);
    Line& points = drawn.emplace_back();
    for (std::size_t i = 0; i < x.size(); ++i) points.emplace_back(x[i], line.y[i]);
  }
  titles.push_back("over " + x_title);
  Frame frame{.area = bounds(drawn)};
  const double top = std::max(frame.area.br().y, 1e-3);
  frame.area.y = std::min(frame.area.y, 0.0);
  frame.area.height = top - frame.area.y;
  frame.area.width = std::max(frame.area.width, 1e-3);
  frame.px_per_x = 1000.0 / frame.area.width;
  frame.px_per_y = 400.0 / frame.area.height;
  write_png(file, draw(frame, drawn, titles));
}

}  // namespace stillmap
