#include "core/picture/png_file.hpp"

#include <png.h>

#include <cassert>
#include <stdexcept>
#include <string>

namespace stillmap {
namespace {

bool write(const std::filesystem::path& file, const cv::Mat& picture) {
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

void write_png(const std::filesystem::path& file, const cv::Mat& picture) {
  assert(picture.type() == CV_8UC3);
  if (file.extension() == ".png" && write(file, picture)) return;
  throw std::runtime_error(file.string() +
                           ": the picture cannot be written; its folder must exist and be "
                           "writable, its name end in .png");
}

}  // namespace stillmap
