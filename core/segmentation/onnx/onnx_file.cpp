#include "core/segmentation/onnx/onnx_file.hpp"

#include <onnx/onnx_pb.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <optional>
#include <set>
#include <string>

#include "core/segmentation/model_error.hpp"

namespace stillmap {
namespace {

static_assert(std::endian::native == std::endian::little, "ONNX's raw data are little-endian");

constexpr std::int64_t max_values = std::int64_t{1} << 28;

/// Number of values, by the tensor's dimensions; empty when they are negative or too large.
std::optional<std::int64_t> value_count(const onnx::TensorProto& tensor) {
  std::int64_t count = 1;
  for (const std::int64_t size : tensor.dims()) {
    if (size < 0 || size > max_values) return std::nullopt;
    if (size > 0 && count > max_values / size) return std::nullopt;
    count *= size;
  }
  return count;
}

template <class T, class Field>
std::vector<T> values(const onnx::TensorProto& tensor, const Field& field) {
  if (!tensor.has_raw_data()) return {field.begin(), field.end()};
  std::vector<T> read(tensor.raw_data().size() / sizeof(T));
  std::memcpy(read.data(), tensor.raw_data().data(), read.size() * sizeof(T));
  return read;
}

/// Values that the file holds, of the types that matter here.
std::int64_t stored_values(const onnx::TensorProto& tensor) {
  const bool is_float = tensor.data_type() == onnx::TensorProto::FLOAT;
  if (tensor.has_raw_data()) {
    const std::size_t bytes = is_float ? sizeof(float) : sizeof(std::int64_t);
    if (tensor.raw_data().size() % bytes != 0) return -1;
    return static_cast<std::int64_t>(tensor.raw_data().size() / bytes);
  }
  return is_float ? tensor.float_data_size() : tensor.int64_data_size();
}

/// What is wrong with a tensor that is stored in the file; empty when it can be used.
std::string tensor_fault(const onnx::TensorProto& tensor) {
  const std::string name = "weights '" + tensor.name() + "'";
  if (tensor.data_location() == onnx::TensorProto::EXTERNAL || tensor.external_data_size() > 0) {
    return name + " lie in another file; export the network as one file";
  }
  const std::optional<std::int64_t> wanted = value_count(tensor);
  if (!wanted) return name + " have dimensions that are negative or absurd";
  const bool is_float = tensor.data_type() == onnx::TensorProto::FLOAT;
  if (!is_float && tensor.data_type() != onnx::TensorProto::INT64) return {};
  if (const std::int64_t stored = stored_values(tensor); stored != *wanted) {
    return name + " are not whole: their dimensions want " + std::to_string(*wanted) +
           " values, the file does not hold as many";
  }
  const std::vector<float> numbers = tensor_floats(tensor);
  const bool finite = std::ranges::all_of(numbers, [](float x) { return std::isfinite(x); });
  return finite ? std::string() : name + " are not all finite numbers";
}

using Names = std::set<std::string>;

bool is_weight(const onnx::GraphProto& graph, const std::string& name) {
  return std::ranges::any_of(graph.initializer(), [&name](const onnx::TensorProto& tensor) {
    return tensor.name() == name;
  });
}

std::string weights_fault(const onnx::GraphProto& graph) {
  Names names;
  for (const onnx::TensorProto& tensor : graph.initializer()) {
    if (std::string fault = tensor_fault(tensor); !fault.empty()) return fault;
    if (!names.insert(tensor.name()).second) {
      return "weights '" + tensor.name() + "' stand in the file twice";
    }
  }
  return {};
}

std::string attribute_fault(const onnx::NodeProto& node) {
  for (const onnx::AttributeProto& attribute : node.attribute()) {
    if (attribute.has_t()) {
      if (std::string fault = tensor_fault(attribute.t()); !fault.empty()) return fault;
    }
  }
  return {};
}

std::string node_text(const onnx::NodeProto& node) {
  return node.op_type() + " '" + (node.name().empty() ? "without a name" : node.name()) + "'";
}

/// What is wrong with a node, given the names of all tensors before it, to which it adds its own.
std::string node_fault(const onnx::NodeProto& node, Names& known) {
  for (const std::string& input : node.input()) {
    if (!input.empty() && !known.contains(input)) {
      return node_text(node) + " reads '" + input +
             "', which is neither a weight in the file nor made before it (missing, or a cycle)";
    }
  }
  for (const std::string& output : node.output()) {
    if (!output.empty() && !known.insert(output).second) {
      return node_text(node) + " makes '" + output + "', which is there already";
    }
  }
  return attribute_fault(node);
}

std::string nodes_fault(const onnx::GraphProto& graph) {
  Names known;
  for (const onnx::ValueInfoProto& input : graph.input()) known.insert(input.name());
  for (const onnx::TensorProto& tensor : graph.initializer()) known.insert(tensor.name());
  for (const onnx::NodeProto& node : graph.node()) {
    if (std::string fault = node_fault(node, known); !fault.empty()) return fault;
  }
  if (!known.contains(graph.output(0).name())) {
    return "no layer makes the network's output '" + graph.output(0).name() + "'";
  }
  return {};
}

/// What makes the file useless for any engine; empty when nothing does.
std::string onnx_fault(const onnx::ModelProto& model) {
  const onnx::GraphProto& graph = model.graph();
  if (graph.node().empty()) return "is not an ONNX network: there is no layer in it";
  if (graph.output_size() != 1) {
    return "has " + std::to_string(graph.output_size()) +
           " outputs; a network that labels range images has one";
  }
  if (network_input(graph) == nullptr) {
    return "does not have exactly one input; a network that labels range images has one";
  }
  if (std::string fault = weights_fault(graph); !fault.empty()) return fault;
  return nodes_fault(graph);
}

namespace fs = std::filesystem;

/// For comparison: RangeNet53 has 200 MB.
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

const onnx::ValueInfoProto* network_input(const onnx::GraphProto& graph) {
  const onnx::ValueInfoProto* found = nullptr;
  for (const onnx::ValueInfoProto& input : graph.input()) {
    if (is_weight(graph, input.name())) continue;
    if (found != nullptr) return nullptr;
    found = &input;
  }
  return found;
}

std::vector<float> tensor_floats(const onnx::TensorProto& tensor) {
  if (tensor.data_type() != onnx::TensorProto::FLOAT) return {};
  return values<float>(tensor, tensor.float_data());
}

std::vector<std::int64_t> tensor_ints(const onnx::TensorProto& tensor) {
  if (tensor.data_type() != onnx::TensorProto::INT64) return {};
  return values<std::int64_t>(tensor, tensor.int64_data());
}

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
