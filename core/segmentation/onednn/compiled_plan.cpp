#include "core/segmentation/onednn/compiled_plan.hpp"

#include <algorithm>
#include <cassert>
#include <dnnl.hpp>

#include "core/segmentation/onednn/dnnl_step.hpp"
#include "core/segmentation/onednn/execution_plan.hpp"
#include "core/segmentation/onednn/openmp_threads.hpp"
#include "core/segmentation/onednn/row_interleaving.hpp"

namespace stillmap {
namespace {

using dnnl::memory;

/// Memory aligned to cache lines.
class AlignedMemory {
 public:
  explicit AlignedMemory(std::size_t bytes) : lines_((bytes + sizeof(Line) - 1) / sizeof(Line)) {}
  [[nodiscard]] std::byte* at(std::size_t byte) {
    return reinterpret_cast<std::byte*>(lines_.data()) + byte;
  }
  [[nodiscard]] std::size_t bytes() const { return lines_.size() * sizeof(Line); }

 private:
  struct alignas(BufferLayout::alignment) Line {
    std::array<std::byte, BufferLayout::alignment> bytes;
  };
  std::vector<Line> lines_;
};

/// A RowInterleaving and its operands.
struct InterleavingStep {
  RowInterleaving interleaving;
  ValueType type = ValueType::f32;
  const void* from = nullptr;
  void* to = nullptr;

  void run() const {
    if (type == ValueType::f32) {
      interleave_rows(interleaving, static_cast<const float*>(from), static_cast<float*>(to));
    } else {
      interleave_rows(interleaving, static_cast<const std::int8_t*>(from),
                      static_cast<std::int8_t*>(to));
    }
  }
};

using CompiledStep = std::variant<DnnlStep, InterleavingStep>;

/// Turns the steps of a plan into primitives with their operands.
class Compiler {
 public:
  Compiler(const NetworkGraph& graph, const ExecutionPlan& plan, const BufferLayout& layout,
           const dnnl::engine& engine, AlignedMemory& activations)
      : graph_(graph), plan_(plan), layout_(layout), engine_(engine), activations_(activations) {}

  CompiledStep operator()(const LoadInput& step) const {
    const DnnlTensor to = tensor(step.to);
    const memory::desc planar({1, to.shape.channels, to.shape.rows, to.shape.columns},
                              memory::data_type::f32, memory::format_tag::nchw);
    return reorder_step({planar, engine_, nullptr}, to.dnnl_memory(engine_), 1.0F);
  }
  CompiledStep operator()(const Convert& step) const {
    return reorder_step(tensor(step.from).dnnl_memory(engine_),
                        tensor(step.to).dnnl_memory(engine_), step.factor);
  }
  CompiledStep operator()(const Convolve& step) const {
    const Layer& layer = graph_.layers[step.layer];
    const auto& c = std::get<Convolution>(layer.operation);
    ConvolutionTensors tensors{.from = tensor(step.from),
                               .to = before_upsampling(c, tensor(step.to)),
                               .sum_scale = step.sum_scale,
                               .added = std::nullopt};
    if (step.added) tensors.added = before_upsampling(c, tensor(*step.added));
    return convolution_step(engine_, layer, tensors);
  }
  CompiledStep operator()(const InterleaveRows& step) const {
    const RowsColumns upsampling =
        std::get<Convolution>(graph_.layers[step.layer].operation).upsampling;
    const DnnlTensor to = tensor(step.to);
    const auto size = [](int number) { return static_cast<std::size_t>(number); };
    return InterleavingStep{
        .interleaving = {.rows = size(to.shape.rows / upsampling.rows),
                         .phases = size(upsampling.rows),
                         .chunk = size(to.shape.channels) * size(upsampling.columns),
                         .chunks = size(to.shape.columns / upsampling.columns),
                         .factor = step.factor,
                         .sum_factor = step.sum_factor},
        .type = to.type,
        .from = tensor(step.from).memory,
        .to = to.memory};
  }
  CompiledStep operator()(const Activate& step) const {
    return activation_step(engine_, tensor(step.from), tensor(step.to), step.slope);
  }
  CompiledStep operator()(const Sum& step) const {
    return sum_step(engine_, tensor(step.first), tensor(step.second), tensor(step.to));
  }

 private:
  /// The tensor in the shape before upsampling, in the same memory.
  static DnnlTensor before_upsampling(const Convolution& c, DnnlTensor tensor) {
    tensor.shape = {.channels = c.outputs,
                    .rows = tensor.shape.rows / c.upsampling.rows,
                    .columns = tensor.shape.columns / c.upsampling.columns};
    return tensor;
  }

  [[nodiscard]] DnnlTensor tensor(const TensorPlacement& place) const {
    return {.memory = activations_.at(layout_.offset[place.buffer]),
            .type = place.type,
            .scale = place.type == ValueType::s8 ? plan_.scale_of_tensor[place.tensor] : 1.0F,
            .shape = graph_.tensors[place.tensor].shape};
  }

  const NetworkGraph& graph_;
  const ExecutionPlan& plan_;
  const BufferLayout& layout_;
  const dnnl::engine& engine_;
  AlignedMemory& activations_;
};

struct StepText {
  const NetworkGraph& graph;

  std::string operator()(const LoadInput& step) const { return "load " + shape(step.to); }
  std::string operator()(const Convert& step) const {
    return (step.from.type == step.to.type ? "copy " : "convert ") + shape(step.to);
  }
  std::string operator()(const Convolve& step) const {
    const auto& c = std::get<Convolution>(graph.layers[step.layer].operation);
    return "convolve " + std::to_string(c.inputs) + " to " + std::to_string(c.outputs) + ", " +
           std::to_string(c.kernel.rows) + "x" + std::to_string(c.kernel.columns) + ", " +
           shape(step.to) + (step.sum_scale ? ", add" : "") + (step.added ? ", add" : "");
  }
  std::string operator()(const InterleaveRows& step) const {
    return "lay out rows of " + shape(step.to) + (step.sum_factor ? ", add" : "");
  }
  std::string operator()(const Activate& step) const { return "activate " + shape(step.to); }
  std::string operator()(const Sum& step) const { return "add " + shape(step.to); }

  [[nodiscard]] std::string shape(const TensorPlacement& place) const {
    return graph.tensors[place.tensor].shape.text() +
           (place.type == ValueType::s8 ? " in int8" : "");
  }
};

}  // namespace

struct CompiledPlan::State {
  State(const NetworkGraph& graph, const ExecutionPlan& plan, int thread_count)
      : threads(thread_count),
        layout(lay_out(plan.buffers)),
        activations(layout.bytes),
        scratchpad(0),
        tensors(graph.tensors) {
    const Compiler compile(graph, plan, layout, engine, activations);
    for (const Step& step : plan.steps) {
      steps.push_back(std::visit(compile, step));
      targets.push_back(target(step));
      texts.push_back(std::visit(StepText{graph}, step));
    }
    output = plan.output;
    add_scratchpad();
  }

  /// One scratchpad for all steps, since they run one after another.
  void add_scratchpad() {
    std::size_t largest = 0;
    const auto each = [this](const auto& work) {
      for (CompiledStep& step : steps) {
        if (auto* const dnnl = std::get_if<DnnlStep>(&step)) work(*dnnl);
      }
    };
    each([&](const DnnlStep& step) { largest = std::max(largest, step.scratchpad.get_size()); });
    scratchpad = AlignedMemory(largest);
    each([&](DnnlStep& step) {
      step.arguments[DNNL_ARG_SCRATCHPAD] = {step.scratchpad, engine, scratchpad.at(0)};
    });
  }

  void run(const CompiledStep& step) {
    if (const auto* const dnnl = std::get_if<DnnlStep>(&step)) {
      dnnl->primitive.execute(stream, dnnl->arguments);
    } else {
      std::get<InterleavingStep>(step).run();
    }
  }

  [[nodiscard]] std::span<const float> values(const TensorPlacement& place) {
    return {reinterpret_cast<const float*>(activations.at(layout.offset[place.buffer])),
            tensors[place.tensor].shape.size()};
  }

  int threads;
  dnnl::engine engine{dnnl::engine::kind::cpu, 0};
  dnnl::stream stream{engine};
  BufferLayout layout;
  AlignedMemory activations;
  AlignedMemory scratchpad;
  std::vector<Tensor> tensors;
  std::vector<CompiledStep> steps;
  std::vector<TensorPlacement> targets;
  std::vector<std::string> texts;
  TensorPlacement output;
};

CompiledPlan::CompiledPlan(const NetworkGraph& graph, const ExecutionPlan& plan, int threads) {
  const int count = threads > 0 ? threads : omp_get_max_threads();
  const OpenMpThreads set(count);
  try {
    state_ = std::make_unique<State>(graph, plan, count);
  } catch (const dnnl::error& error) {
    throw UnsupportedLayer(std::string("oneDNN refuses the network: ") + error.what());
  }
}

CompiledPlan::~CompiledPlan() = default;

std::span<const float> CompiledPlan::run(std::span<const float> input) { return run(input, {}); }

std::span<const float> CompiledPlan::run(std::span<const float> input, const Observer& observer) {
  const OpenMpThreads set(state_->threads);
  assert(input.size() == state_->tensors[state_->targets.front().tensor].shape.size());
  // oneDNN reads through this pointer, although its type allows writing.
  auto& load = std::get<DnnlStep>(state_->steps.front());
  load.arguments.at(DNNL_ARG_FROM).set_data_handle(const_cast<float*>(input.data()));
  for (std::size_t i = 0; i < state_->steps.size(); ++i) {
    state_->run(state_->steps[i]);
    const TensorPlacement& to = state_->targets[i];
    if (observer && to.type == ValueType::f32) observer(to.tensor, state_->values(to));
  }
  state_->stream.wait();
  return state_->values(state_->output);
}

int CompiledPlan::threads() const { return state_->threads; }

std::size_t CompiledPlan::memory_bytes() const {
  std::size_t bytes = state_->activations.bytes() + state_->scratchpad.bytes();
  for (const CompiledStep& step : state_->steps) {
    const auto* const dnnl = std::get_if<DnnlStep>(&step);
    if (dnnl == nullptr || !dnnl->arguments.contains(DNNL_ARG_WEIGHTS)) continue;
    bytes += dnnl->arguments.at(DNNL_ARG_WEIGHTS).get_desc().get_size();
  }
  return bytes;
}

std::vector<std::string> CompiledPlan::steps() const {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < state_->steps.size(); ++i) {
    const auto* const dnnl = std::get_if<DnnlStep>(&state_->steps[i]);
    lines.push_back(state_->texts[i] + ": " + (dnnl == nullptr ? "own" : dnnl->implementation));
  }
  return lines;
}

}  // namespace stillmap
