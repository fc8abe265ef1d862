#include "core/picture/segmentation_picture.hpp"

#include <opencv2/imgproc.hpp>

#include "core/picture/map_canvas.hpp"

namespace stillmap {
namespace {

// A range image is flat; taller pixels show poles and people.
constexpr int pixel_height = 3;
constexpr int gap_rows = 1;

void draw(cv::Mat& strip, const RangeImage& image, std::span<const SemanticClass> classes) {
  for (int row = 0; row < image.rows(); ++row) {
    for (int column = 0; column < image.columns(); ++column) {
      const std::int32_t point = image.nearest()[image.pixel(row, column)];
      if (point == RangeImage::none) continue;
      const Rgb rgb = colour(classes[static_cast<std::size_t>(point)]);
      strip.at<cv::Vec3b>(row, column) = {rgb.b, rgb.g, rgb.r};
    }
  }
}

}  // namespace

void write_segmentation_picture(const std::filesystem::path& file, const RangeImage& image,
                                std::span<const std::span<const SemanticClass>> classes) {
  const int rows = image.rows() + gap_rows;
  cv::Mat picture(rows * static_cast<int>(classes.size()), image.columns(), CV_8UC3, cv::Scalar());
  for (std::size_t i = 0; i < classes.size(); ++i) {
    cv::Mat strip = picture.rowRange(static_cast<int>(i) * rows, picture.rows);
    draw(strip, image, classes[i]);
  }
  cv::Mat tall;
  cv::resize(picture, tall, {}, 1.0, pixel_height, cv::INTER_NEAREST);
  write_png(file, tall);
}

}  // namespace stillmap
