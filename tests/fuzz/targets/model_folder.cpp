// model.yaml, and behind the first line of "===" int8.yaml, of a model folder.

#include <filesystem>

#include "config/loaders/int8_file.hpp"
#include "config/loaders/model_file.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/memory_folder.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace model_folder_inputs {
namespace {

constexpr const char* separator = "\n===\n";

void run(Bytes bytes) {
  const std::string text = text_of(bytes);
  const auto& folder = MemoryFolder::of_this_process();
  const std::size_t end = text.find(separator);
  folder.file("model/model.yaml", text.substr(0, end));
  folder.remove("model/int8.yaml");
  if (end != std::string::npos) {
    folder.file("model/int8.yaml", text.substr(end + std::char_traits<char>::length(separator)));
  }
  try {
    const ModelDescription model = load_model_description(folder.path("model"));
    require(model.faults().empty(), "a model that was read can be used");
    static_cast<void>(for_sensor(model, vlp_16()));
  } catch (const ConfigError& error) {
    require(!error.faults().empty(), "a refusal says why");
  }
}

std::vector<Seed> seeds() {
  const std::filesystem::path folder =
      std::filesystem::path(STILLMAP_CONFIG_FOLDER) / "models/street";
  const std::string model = content_of(folder / "model.yaml");
  Int8Calibration calibration;
  calibration.made = "by hand";
  calibration.range_of_channels = {{"conv", {1.0F, 0.5F}}, {"sum", {2.0F}}};
  calibration.float_layers = {"head"};
  const auto file = MemoryFolder::of_this_process().path("seed_int8.yaml");
  save_int8_calibration(calibration, file);
  return {{"model", model}, {"int8", model + separator + content_of(file)}};
}

}  // namespace
}  // namespace model_folder_inputs

const Target model_folder_target{"model_folder", model_folder_inputs::run,
                                 model_folder_inputs::seeds};

}  // namespace stillmap::fuzz
