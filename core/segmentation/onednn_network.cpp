#include "core/segmentation/onednn_network.hpp"

#include <dnnl.h>

#include <cassert>

#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/network_input.hpp"
#include "core/segmentation/onednn/compiled_plan.hpp"
#include "core/segmentation/onednn/execution_plan.hpp"
#include "core/segmentation/onednn/openmp_threads.hpp"
#include "core/segmentation/onednn/prepare_network.hpp"
#include "core/segmentation/pixel_scores.hpp"

namespace stillmap {
namespace {

/// Throws ModelError where the model has no calibration, or one of another network.
const Int8Calibration& calibration_of(const ModelDescription& model,
                                      const PreparedNetwork& network) {
  if (!model.int8) {
    throw ModelError(model.network_file,
                     "has no int8.yaml beside it; make it with 'stillmap model calibrate', or use "
                     "precision: fp32");
  }
  const std::filesystem::path file = model.network_file.parent_path() / "int8.yaml";
  const std::string& made_with = model.int8->network_crc32;
  const std::string present = made_with.empty() ? "" : crc32_of(model.network_file);
  if (made_with != present) {
    throw ModelError(file, "was made with another " + model.network_file.filename().string() +
                               " (network_crc32 is " + made_with + ", that of the file " + present +
                               "): calibrate again with 'stillmap model calibrate', or use "
                               "precision: fp32");
  }
  std::string fault = float_layer_fault(network.file_layers, *model.int8);
  if (fault.empty()) fault = calibration_fault(network.graph, *model.int8);
  if (!fault.empty()) {
    throw ModelError(file, fault +
                               "; the file is damaged or another network's: calibrate again with "
                               "'stillmap model calibrate', or use precision: fp32");
  }
  return *model.int8;
}

/// The graph in this precision; for int8 its channels are equalised first.
std::unique_ptr<CompiledPlan> compile(Precision precision, PreparedNetwork& network,
                                      const ModelDescription& model, int threads) {
  NetworkGraph& graph = network.graph;
  std::optional<Int8Calibration> calibration;
  if (precision == Precision::int8)
    calibration = equalise_channels(graph, calibration_of(model, network));
  const auto compiled = [&](FloatSummand float_summand) {
    const ExecutionPlan plan =
        plan_execution(graph, calibration ? &*calibration : nullptr, float_summand);
    return std::make_unique<CompiledPlan>(graph, plan, threads);
  };
  try {
    return compiled(FloatSummand::in_place);
  } catch (const UnsupportedLayer&) {
    // Of this processor, maybe.
    return compiled(FloatSummand::apart);
  }
}

PreparedNetwork load(const ModelDescription& model) {
  require_valid(model);
  const OnnxFile file(model.network_file);
  require_input_shape(file, static_cast<int>(model.statistics.channels), model.rows, model.columns);
  return prepare_network(file, model);
}

}  // namespace

struct OneDnnNetwork::State {
  std::vector<Tensor> tensors;
  std::size_t outputs = 0;
  ScoreKind kind = ScoreKind::logits;
  Precision precision = Precision::fp32;
  double giga_operations = 0.0;
  std::unique_ptr<CompiledPlan> plan;
};

OneDnnNetwork::OneDnnNetwork(const ModelDescription& model, Precision precision, int threads)
    : state_(std::make_unique<State>()) {
  try {
    PreparedNetwork network = load(model);
    NetworkGraph& graph = network.graph;
    state_->tensors = graph.tensors;
    state_->outputs = model.classes.size();
    state_->precision = precision;
    state_->giga_operations = network.giga_operations;
    state_->plan = compile(precision, network, model, threads);
    const std::span<const float> scores = state_->plan->run(trial_input(model));
    require_finite_scores(model, scores);
    if (!network.had_softmax) {
      state_->kind = score_kind(scores, state_->outputs, ScoreLayout::pixels);
    }
  } catch (const UnsupportedLayer& fault) {
    throw UnsupportedModel(model.network_file, std::string(fault.what()) +
                                                   ": the oneDNN engine cannot run it; 'engine: "
                                                   "opencv' runs any ONNX network, slower");
  } catch (const GraphFault& fault) {
    throw ModelError(model.network_file, fault.what());
  }
}

OneDnnNetwork::~OneDnnNetwork() = default;

PixelOutputs OneDnnNetwork::run(std::span<const float> input) {
  return argmax_outputs(state_->plan->run(input), state_->outputs, state_->kind,
                        ScoreLayout::pixels);
}

std::vector<float> OneDnnNetwork::probabilities(std::span<const float> input) {
  return probabilities_of(state_->plan->run(input), state_->outputs, state_->kind,
                          ScoreLayout::pixels);
}

int OneDnnNetwork::threads() const { return state_->plan->threads(); }

std::string OneDnnNetwork::engine() const {
  return std::string("oneDNN ") + (state_->precision == Precision::int8 ? "int8, " : "fp32, ") +
         std::to_string(threads()) + (threads() == 1 ? " thread" : " threads");
}

void OneDnnNetwork::observe(std::span<const float> input, const Observer& observer) {
  state_->plan->run(input, [&](TensorId tensor, std::span<const float> values) {
    const Tensor& of = state_->tensors[tensor];
    observer(of.name, values, static_cast<std::size_t>(of.shape.channels));
  });
}

double OneDnnNetwork::giga_operations() const { return state_->giga_operations; }
std::size_t OneDnnNetwork::memory_bytes() const { return state_->plan->memory_bytes(); }
std::vector<std::string> OneDnnNetwork::steps() const { return state_->plan->steps(); }

namespace {

/// Rows and columns of the matrices.
constexpr dnnl_dim_t size = 1536;
constexpr std::size_t values = static_cast<std::size_t>(size) * static_cast<std::size_t>(size);

}  // namespace

MatrixProduct::MatrixProduct(Precision precision, int threads)
    : precision_(precision), threads_(threads > 0 ? threads : omp_get_max_threads()) {
  if (precision == Precision::fp32) {
    left_.assign(values, 0.5F);
    right_.assign(values, 0.25F);
    product_.assign(values, 0.0F);
  } else {
    left_u8_.assign(values, 3);
    right_s8_.assign(values, 2);
    product_s32_.assign(values, 0);
  }
}

void MatrixProduct::run() {
  const OpenMpThreads set(threads_);
  if (precision_ == Precision::fp32) {
    dnnl_sgemm('N', 'N', size, size, size, 1.0F, left_.data(), size, right_.data(), size, 0.0F,
               product_.data(), size);
  } else {
    const std::int32_t offset = 0;
    dnnl_gemm_u8s8s32('N', 'N', 'F', size, size, size, 1.0F, left_u8_.data(), size, 0,
                      right_s8_.data(), size, 0, 0.0F, product_s32_.data(), size, &offset);
  }
}

double MatrixProduct::giga_operations() {
  return 2.0 * static_cast<double>(size) * static_cast<double>(values) / 1e9;
}

}  // namespace stillmap
