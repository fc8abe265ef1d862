#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

namespace stillmap {

/// Shape that an ONNX file declares for its network's input; a size that is left open is 0. Empty
/// when the file declares none, or is damaged.
///
/// OpenCV does not look at it, and runs a network on images for which it was not made.
[[nodiscard]] std::vector<std::int64_t> declared_input_shape(std::string_view onnx_bytes);

}  // namespace stillmap
