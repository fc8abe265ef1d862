#pragma once

#include <string>

namespace onnx {
class GraphProto;
class ModelProto;
class ValueInfoProto;
}  // namespace onnx

namespace stillmap {

/// What makes the file useless for any engine; empty when nothing does.
[[nodiscard]] std::string onnx_fault(const onnx::ModelProto& model);

/// The one input that is not a weight (old files list their weights among the inputs); null when
/// there is none or more than one.
[[nodiscard]] const onnx::ValueInfoProto* network_input(const onnx::GraphProto& graph);

}  // namespace stillmap
