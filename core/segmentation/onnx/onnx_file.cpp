#include "core/segmentation/onnx/onnx_file.hpp"

#include <onnx/onnx_pb.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string>

#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onnx/onnx_check.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// RangeNet53 has 200 MB.
constexpr std::uintmax_t max_file_bytes = std::uintmax_t{1} << 30;

std::unique_ptr<onnx::ModelProto> parse(const fs::path& file) {
  if (!fs::is_regular_file(file)) throw ModelError(file, "is not a file that can be read");
  if (fs::file_size(file) > max_file_bytes) {
    throw ModelError(file, "has more than 1 GiB, which no network of this family has");
  }
  std::ifstream stream(file, std::ios::binary);
  auto model = std::make_unique<onnx::ModelProto>();
  if (!stream || !model->ParseFromIstream(&stream)) {
    throw ModelError(file, "is not an ONNX network: it cannot be read, is truncated or damaged");
  }
  return model;
}

template <typename Sizes>
std::string shape_text(const Sizes& sizes) {
  std::string text;
  for (const auto size : sizes) {
    if (!text.empty()) text += 'x';
    text += size == 0 ? std::string("?") : std::to_string(size);
  }
  return text;
}

}  // namespace

OnnxFile::OnnxFile(const fs::path& file) : file_(file), model_(parse(file)) {
  const std::string fault = onnx_fault(*model_);
  if (!fault.empty()) throw ModelError(file, fault);
}

OnnxFile::~OnnxFile() = default;

std::vector<std::int64_t> OnnxFile::declared_input_shape() const {
  const onnx::ValueInfoProto* const input = network_input(model_->graph());
  if (input == nullptr || !input->type().tensor_type().has_shape()) return {};
  std::vector<std::int64_t> shape;
  for (const auto& dimension : input->type().tensor_type().shape().dim()) {
    shape.push_back(std::max<std::int64_t>(0, dimension.dim_value()));
  }
  return shape;
}

void require_input_shape(const OnnxFile& file, int channels, int rows, int columns) {
  const std::vector<std::int64_t> declared = file.declared_input_shape();
  const std::array<std::int64_t, 4> wanted{1, channels, rows, columns};
  const auto fits = [](std::int64_t size, std::int64_t wanted_size) {
    return size == 0 || size == wanted_size;
  };
  if (declared.empty() || std::ranges::equal(declared, wanted, fits)) return;
  throw ModelError(file.file(), "wants an input of " + shape_text(declared) +
                                    ", but its description has " + shape_text(wanted) +
                                    " (1 x 5 x rows x columns)");
}

}  // namespace stillmap
