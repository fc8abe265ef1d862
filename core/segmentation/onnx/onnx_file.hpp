#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace onnx {
class ModelProto;
}  // namespace onnx
namespace onnx {
class GraphProto;
class ModelProto;
class ValueInfoProto;
}  // namespace onnx
namespace onnx {
class TensorProto;
}  // namespace onnx

namespace stillmap {

/// An ONNX file that was read and looked over: its weights are whole, finite and in the file, and
/// each layer reads only what stands before it. Engines can trust that much, and OpenCV does not
/// look.
class OnnxFile {
 public:
  /// Throws ModelError.
  explicit OnnxFile(const std::filesystem::path& file);
  ~OnnxFile();
  OnnxFile(const OnnxFile&) = delete;
  OnnxFile& operator=(const OnnxFile&) = delete;

  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  [[nodiscard]] const onnx::ModelProto& model() const { return *model_; }

  /// Shape of the network's input; a size that the file leaves open is 0. Empty when the file does
  /// not say.
  [[nodiscard]] std::vector<std::int64_t> declared_input_shape() const;

 private:
  std::filesystem::path file_;
  std::unique_ptr<onnx::ModelProto> model_;
};

/// Refuses a network that is made for another image than 1 x channels x rows x columns. Throws
/// ModelError.
void require_input_shape(const OnnxFile& file, int channels, int rows, int columns);

/// What makes the file useless for any engine; empty when nothing does.
[[nodiscard]] std::string onnx_fault(const onnx::ModelProto& model);

/// The one input that is not a weight (old files list their weights among the inputs); null when
/// there is none or more than one.
[[nodiscard]] const onnx::ValueInfoProto* network_input(const onnx::GraphProto& graph);

/// What is wrong with a tensor that is stored in an ONNX file; empty when it can be used.
[[nodiscard]] std::string tensor_fault(const onnx::TensorProto& tensor);

/// Number of values, by the tensor's dimensions. The tensor has no fault.
[[nodiscard]] std::size_t value_count(const onnx::TensorProto& tensor);

/// The values of a tensor without a fault; empty when it is not one of this type.
[[nodiscard]] std::vector<float> float_values(const onnx::TensorProto& tensor);
[[nodiscard]] std::vector<std::int64_t> int_values(const onnx::TensorProto& tensor);

}  // namespace stillmap
