#include "core/segmentation/onednn/dnnl_step.hpp"

namespace stillmap {

using dnnl::memory;

memory::data_type dnnl_type(ValueType type) {
  return type == ValueType::s8 ? memory::data_type::s8 : memory::data_type::f32;
}

memory::desc DnnlTensor::desc() const {
  return {
      {1, shape.channels, shape.rows, shape.columns}, dnnl_type(type), memory::format_tag::nhwc};
}

dnnl::primitive_attr step_attributes() {
  dnnl::primitive_attr attributes;
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
  return attributes;
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

}  // namespace stillmap
