#include "config/loaders/int8_file.hpp"

#include <yaml-cpp/yaml.h>

#include <fstream>
#include <system_error>

#include "config/loaders/yaml_section.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

void read_ranges(YamlSection section,
                 std::map<std::string, std::vector<float>>& range_of_channels) {
  for (const std::string& tensor : section.names()) {
    std::vector<double> ranges;
    section.number_list(tensor, ranges, {0, 1e9});
    range_of_channels[tensor].assign(ranges.begin(), ranges.end());
  }
}

}  // namespace

std::optional<Int8Calibration> load_int8_calibration(const fs::path& file) {
  if (!fs::exists(file)) return std::nullopt;
  YamlFile yaml = open_yaml(file);
  Int8Calibration calibration;
  {
    YamlSection section(yaml);
    section.require({"ranges"});
    section.text("made", calibration.made);
    section.text("network_crc32", calibration.network_crc32);
    section.text_list("float_layers", calibration.float_layers);
    read_ranges(section.section("ranges"), calibration.range_of_channels);
  }
  yaml.require_no_faults();
  return calibration;
}

void save_int8_calibration(const Int8Calibration& calibration, const fs::path& file) {
  YAML::Emitter text;
  text << YAML::Comment("Written by 'stillmap model calibrate'.") << YAML::BeginMap;
  text << YAML::Key << "made" << YAML::Value << YAML::DoubleQuoted << calibration.made;
  if (!calibration.network_crc32.empty()) {
    text << YAML::Key << "network_crc32" << YAML::Value << YAML::DoubleQuoted
         << calibration.network_crc32 << YAML::Comment("of model.onnx, to which the ranges belong");
  }
  text << YAML::Key << "float_layers" << YAML::Value << YAML::Flow << YAML::BeginSeq;
  for (const std::string& layer : calibration.float_layers) text << YAML::DoubleQuoted << layer;
  text << YAML::EndSeq;
  text << YAML::Comment("these run in floating point, besides the first and the last layer");
  text << YAML::Key << "ranges"
       << YAML::Comment("largest magnitude that each channel of each tensor may have")
       << YAML::Value << YAML::BeginMap << YAML::FloatPrecision(5);
  for (const auto& [tensor, ranges] : calibration.range_of_channels) {
    text << YAML::Key << YAML::DoubleQuoted << tensor << YAML::Value << YAML::Flow << ranges;
  }
  text << YAML::EndMap << YAML::EndMap;
  // What was there stays until this is whole.
  const fs::path fresh = file.string() + ".new";
  std::ofstream stream(fresh, std::ios::trunc);
  stream << text.c_str() << "\n";
  stream.close();
  std::error_code fault;
  if (stream) fs::rename(fresh, file, fault);
  if (!stream || fault) {
    std::error_code ignored;
    fs::remove(fresh, ignored);
    throw ConfigError({file.string() + ": cannot be written; check the folder and the space left"});
  }
}

}  // namespace stillmap
