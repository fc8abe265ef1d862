#include "core/segmentation/onednn/dnnl_step.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace stillmap {

using dnnl::memory;

namespace {

memory::data_type dnnl_type(ValueType type) {
  return type == ValueType::s8 ? memory::data_type::s8 : memory::data_type::f32;
}

/// Scratch memory comes from the caller.
dnnl::primitive_attr step_attributes() {
  dnnl::primitive_attr attributes;
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
  return attributes;
}

}  // namespace

memory::desc DnnlTensor::desc() const {
  return {
      {1, shape.channels, shape.rows, shape.columns}, dnnl_type(type), memory::format_tag::nhwc};
}

DnnlStep reorder_step(const memory& from, const memory& to, float factor) {
  dnnl::primitive_attr attributes = step_attributes();
  if (factor != 1.0F) attributes.set_output_scales(0, {factor});
  const dnnl::reorder::primitive_desc primitive(from, to, attributes);
  return {.primitive = dnnl::reorder(primitive),
          .arguments = {{DNNL_ARG_FROM, from}, {DNNL_ARG_TO, to}},
          .scratchpad = primitive.scratchpad_desc(),
          .implementation = primitive.impl_info_str()};
}

DnnlStep activation_step(const dnnl::engine& engine, const DnnlTensor& from, const DnnlTensor& to,
                         float slope) {
  const dnnl::eltwise_forward::desc desc(dnnl::prop_kind::forward_inference,
                                         dnnl::algorithm::eltwise_relu, from.desc(), slope, 0.0F);
  const dnnl::eltwise_forward::primitive_desc primitive(desc, step_attributes(), engine);
  return {.primitive = dnnl::eltwise_forward(primitive),
          .arguments = {{DNNL_ARG_SRC, from.dnnl_memory(engine)},
                        {DNNL_ARG_DST, to.dnnl_memory(engine)}},
          .scratchpad = primitive.scratchpad_desc(),
          .implementation = primitive.impl_info_str()};
}

DnnlStep sum_step(const dnnl::engine& engine, const DnnlTensor& first, const DnnlTensor& second,
                  const DnnlTensor& to) {
  const dnnl::binary::desc desc(dnnl::algorithm::binary_add, first.desc(), second.desc(),
                                to.desc());
  const dnnl::binary::primitive_desc primitive(desc, step_attributes(), engine);
  return {.primitive = dnnl::binary(primitive),
          .arguments = {{DNNL_ARG_SRC_0, first.dnnl_memory(engine)},
                        {DNNL_ARG_SRC_1, second.dnnl_memory(engine)},
                        {DNNL_ARG_DST, to.dnnl_memory(engine)}},
          .scratchpad = primitive.scratchpad_desc(),
          .implementation = primitive.impl_info_str()};
}

namespace {

using Dims = memory::dims;

constexpr float largest_s8 = 127.0F;

/// Weights of a convolution in the type that it computes in, and for s8 one factor per output from
/// sums of products to the target's scale.
struct Weights {
  std::vector<float> values;
  std::vector<float> bias;
  std::vector<float> output_factors;
};

/// Symmetric quantisation with one scale per output: the largest weight of an output becomes 127.
/// The bias stays in floating point, in units of the products.
Weights integer_weights(const Convolution& c, float input_scale, float output_scale) {
  Weights to{.values = c.weights, .bias = c.bias, .output_factors = {}};
  const std::size_t per_output = c.weights.size() / c.bias.size();
  for (std::size_t o = 0; o < c.bias.size(); ++o) {
    const auto weights = std::span(to.values).subspan(o * per_output, per_output);
    float largest = 0.0F;
    for (const float weight : weights) largest = std::max(largest, std::abs(weight));
    const float scale = largest > 0.0F ? largest / largest_s8 : 1.0F;
    for (float& weight : weights) weight = std::nearbyint(weight / scale);
    to.bias[o] /= input_scale * scale;
    to.output_factors.push_back(input_scale * scale / output_scale);
  }
  return to;
}

/// Scale of the sums: of the second summand, which oneDNN cannot rescale, or else of the target.
float working_scale(const ConvolutionTensors& tensors) {
  return tensors.added ? tensors.added->scale : tensors.to.scale;
}

dnnl::post_ops post_ops(const Layer& layer, const ConvolutionTensors& tensors) {
  const float scale = working_scale(tensors);
  dnnl::post_ops after;
  bool is_in_place = tensors.sum_scale.has_value();
  bool is_apart = tensors.added.has_value();
  for (const PostOp& step : layer.post_ops) {
    if (const auto* const activation = std::get_if<LeakyRelu>(&step)) {
      after.append_eltwise(1.0F, dnnl::algorithm::eltwise_relu, activation->slope, 0.0F);
    } else if (std::exchange(is_in_place, false)) {
      after.append_sum(*tensors.sum_scale / scale);
    } else if (std::exchange(is_apart, false)) {
      after.append_binary(dnnl::algorithm::binary_add, tensors.added->desc());
    }
  }
  if (scale != tensors.to.scale) {
    after.append_eltwise(1.0F, dnnl::algorithm::eltwise_linear, scale / tensors.to.scale, 0.0F);
  }
  return after;
}

/// Index of the binary post-op.
int position_of_added(const dnnl::post_ops& after) {
  int position = 0;
  while (after.kind(position) != dnnl::primitive::kind::binary) ++position;
  return position;
}

dnnl::convolution_forward::primitive_desc describe(const dnnl::engine& engine, const Layer& layer,
                                                   const DnnlTensor& from, const DnnlTensor& to,
                                                   const dnnl::primitive_attr& attributes) {
  const auto& c = std::get<Convolution>(layer.operation);
  const memory::desc weights({c.outputs, c.inputs, c.kernel.rows, c.kernel.columns},
                             dnnl_type(from.type), memory::format_tag::any);
  const memory::desc bias({c.outputs}, memory::data_type::f32, memory::format_tag::a);
  const dnnl::convolution_forward::desc desc(
      dnnl::prop_kind::forward_inference, dnnl::algorithm::convolution_direct, from.desc(), weights,
      bias, to.desc(), Dims{c.stride.rows, c.stride.columns},
      Dims{c.dilation.rows - 1, c.dilation.columns - 1}, Dims{c.padding.top, c.padding.left},
      Dims{c.padding.bottom, c.padding.right});
  return {desc, attributes, engine};
}

/// Copies values into memory of the layout that oneDNN chose.
memory in_layout(const dnnl::engine& engine, const std::vector<float>& values, const Dims& dims,
                 memory::format_tag tag, const memory::desc& layout) {
  // oneDNN reads through this pointer, although its type allows writing.
  memory plain({dims, memory::data_type::f32, tag}, engine, const_cast<float*>(values.data()));
  memory chosen(layout, engine);
  dnnl::stream stream(engine);
  dnnl::reorder(plain, chosen).execute(stream, plain, chosen);
  stream.wait();
  return chosen;
}

}  // namespace

DnnlStep convolution_step(const dnnl::engine& engine, const Layer& layer,
                          const ConvolutionTensors& tensors) {
  const auto& c = std::get<Convolution>(layer.operation);
  const DnnlTensor& from = tensors.from;
  const DnnlTensor& to = tensors.to;
  const bool integers = from.type == ValueType::s8;
  const Weights weights = integers ? integer_weights(c, from.scale, working_scale(tensors))
                                   : Weights{c.weights, c.bias, {}};
  dnnl::primitive_attr attributes = step_attributes();
  const dnnl::post_ops after = post_ops(layer, tensors);
  attributes.set_post_ops(after);
  constexpr int one_an_output = 2;
  if (integers) attributes.set_output_scales(one_an_output, weights.output_factors);
  const auto primitive = describe(engine, layer, from, to, attributes);
  std::string implementation = primitive.impl_info_str();
  if (implementation.find("ref") != std::string::npos) {
    throw UnsupportedLayer("layer '" + layer.name +
                           "': oneDNN has only slow reference code for it on this processor (" +
                           implementation + ")");
  }
  const Dims shape{c.outputs, c.inputs, c.kernel.rows, c.kernel.columns};
  DnnlStep step{
      .primitive = dnnl::convolution_forward(primitive),
      .arguments = {{DNNL_ARG_SRC, from.dnnl_memory(engine)},
                    {DNNL_ARG_DST, to.dnnl_memory(engine)},
                    {DNNL_ARG_WEIGHTS,
                     in_layout(engine, weights.values, shape, memory::format_tag::oihw,
                               primitive.weights_desc())},
                    {DNNL_ARG_BIAS, in_layout(engine, weights.bias, {c.outputs},
                                              memory::format_tag::a, primitive.bias_desc())}},
      .scratchpad = primitive.scratchpad_desc(),
      .implementation = std::move(implementation)};
  if (tensors.added) {
    const int added = DNNL_ARG_ATTR_MULTIPLE_POST_OP(position_of_added(after)) | DNNL_ARG_SRC_1;
    step.arguments.emplace(added, tensors.added->dnnl_memory(engine));
  }
  return step;
}

}  // namespace stillmap
