#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

namespace onnx {
class ModelProto;
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

}  // namespace stillmap
