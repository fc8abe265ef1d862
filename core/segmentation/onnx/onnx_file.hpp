#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace onnx {
class GraphProto;
class ModelProto;
class TensorProto;
class ValueInfoProto;
}  // namespace onnx

namespace stillmap {

/// A parsed and validated ONNX file: all weights are complete, finite and stored in the file
/// itself, and each layer reads only tensors that are made before it. Both engines rely on this;
/// OpenCV does not check it.
class OnnxFile {
 public:
  /// Throws ModelError.
  explicit OnnxFile(const std::filesystem::path& file);
  ~OnnxFile();
  OnnxFile(const OnnxFile&) = delete;
  OnnxFile& operator=(const OnnxFile&) = delete;

  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  [[nodiscard]] const onnx::ModelProto& model() const { return *model_; }

  /// Shape of the network's input, 0 for a dynamic dimension. Empty when the file declares none.
  [[nodiscard]] std::vector<std::int64_t> declared_input_shape() const;

 private:
  std::filesystem::path file_;
  std::unique_ptr<onnx::ModelProto> model_;
};

/// Throws ModelError when the network declares another input than 1 x channels x rows x columns.
void require_input_shape(const OnnxFile& file, int channels, int rows, int columns);

/// The one input that is not a weight (old files list weights among the inputs); null when there is
/// none or more than one.
[[nodiscard]] const onnx::ValueInfoProto* network_input(const onnx::GraphProto& graph);

/// The values of a tensor of an OnnxFile; empty when they are of another type.
[[nodiscard]] std::vector<float> tensor_floats(const onnx::TensorProto& tensor);
[[nodiscard]] std::vector<std::int64_t> tensor_ints(const onnx::TensorProto& tensor);

}  // namespace stillmap
