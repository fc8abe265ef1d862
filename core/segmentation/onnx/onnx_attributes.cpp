#include "core/segmentation/onnx/onnx_attributes.hpp"

#include <onnx/onnx_pb.h>

#include <algorithm>

namespace stillmap {
namespace {

/// No kernel, stride or padding of a sound network is as large.
constexpr std::int64_t max_number = 4096;

}  // namespace

std::string layer_name(const onnx::NodeProto& node) {
  if (!node.name().empty()) return node.name();
  return node.output().empty() ? node.op_type() : node.output(0);
}

const onnx::AttributeProto* OnnxAttributes::find(const std::string& name) const {
  const auto found = std::ranges::find_if(
      node_.attribute(), [&name](const auto& attribute) { return attribute.name() == name; });
  return found == node_.attribute().end() ? nullptr : &*found;
}

void OnnxAttributes::refuse(const std::string& name, const std::string& fault) const {
  throw GraphFault("layer '" + layer_name(node_) + "': " + name + " " + fault);
}

float OnnxAttributes::real(const std::string& name, float default_value) const {
  const onnx::AttributeProto* const attribute = find(name);
  return attribute == nullptr ? default_value : attribute->f();
}

std::int64_t OnnxAttributes::whole(const std::string& name, std::int64_t default_value) const {
  const onnx::AttributeProto* const attribute = find(name);
  return attribute == nullptr ? default_value : attribute->i();
}

std::string OnnxAttributes::text(const std::string& name) const {
  const onnx::AttributeProto* const attribute = find(name);
  return attribute == nullptr ? std::string() : attribute->s();
}

std::vector<std::int64_t> OnnxAttributes::whole_numbers(const std::string& name) const {
  const onnx::AttributeProto* const attribute = find(name);
  if (attribute == nullptr) return {};
  return {attribute->ints().begin(), attribute->ints().end()};
}

std::vector<int> OnnxAttributes::small_numbers(const std::string& name, int min_value,
                                               std::vector<int> default_value) const {
  const std::vector<std::int64_t> written = whole_numbers(name);
  if (written.empty()) return default_value;
  if (written.size() != default_value.size()) {
    refuse(name, "has " + std::to_string(written.size()) + " numbers where " +
                     std::to_string(default_value.size()) + " are wanted: not an image?");
  }
  for (std::size_t i = 0; i < written.size(); ++i) {
    if (written[i] < min_value || written[i] > max_number) {
      refuse(name, "is " + std::to_string(written[i]) + ", but must be " +
                       std::to_string(min_value) + ".." + std::to_string(max_number));
    }
    default_value[i] = static_cast<int>(written[i]);
  }
  return default_value;
}

RowsColumns OnnxAttributes::pair(const std::string& name, int min_value,
                                 RowsColumns default_value) const {
  const std::vector<int> pair =
      small_numbers(name, min_value, {default_value.rows, default_value.columns});
  return {.rows = pair[0], .columns = pair[1]};
}

Padding OnnxAttributes::padding() const {
  if (const std::string how = text("auto_pad"); !how.empty() && how != "NOTSET") {
    throw UnsupportedLayer("layer '" + layer_name(node_) + "': auto_pad " + how +
                           " is not supported");
  }
  const std::vector<int> pads = small_numbers("pads", 0, {0, 0, 0, 0});
  return {.top = pads[0], .left = pads[1], .bottom = pads[2], .right = pads[3]};
}

}  // namespace stillmap
