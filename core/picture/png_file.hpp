#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>

namespace stillmap {

/// Writes a picture of 8-bit blue, green, red (CV_8UC3). Throws std::runtime_error naming the file
/// when its name does not end in .png or it cannot be written.
void write_png(const std::filesystem::path& file, const cv::Mat& picture);

}  // namespace stillmap
