#include "config/loaders/yaml_file.hpp"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <fstream>
#include <sstream>

#include "config/loaders/config_error.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

// A configuration is a few kilobytes; anything near this size is some other file.
constexpr std::uintmax_t max_file_bytes = 1U << 20U;

[[noreturn]] void refuse(const fs::path& file, const std::string& text) {
  throw ConfigError({file.string() + ": " + text});
}

std::string read_text(const fs::path& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) refuse(file, "there is no such file");
  if (fs::is_directory(status)) refuse(file, "is a folder; a YAML file is wanted");
  if (!fs::is_regular_file(status)) refuse(file, "is not a regular file");
  if (fs::file_size(file, error) > max_file_bytes) {
    refuse(file, "is larger than 1 MB and so no configuration file");
  }
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) refuse(file, "cannot be read; check that it is not empty and its permissions");
  return text.str();
}

bool is_text(const std::string& content) {
  for (const char byte : content) {
    const auto code = static_cast<unsigned char>(byte);
    if (code < 0x20 && byte != '\n' && byte != '\r' && byte != '\t') return false;
  }
  return true;
}

/// Hears of all that is in a document, and keeps nothing.
class Ignore final : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t,
                const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
};

/// YAML::Load() silently leaves out what follows the first document, and YAML::LoadAll() never
/// returns where a stray bracket follows it.
bool is_one_document(const std::string& content) {
  std::istringstream stream(content);
  YAML::Parser parser(stream);
  Ignore ignore;
  return !parser.HandleNextDocument(ignore) || !parser.HandleNextDocument(ignore);
}

}  // namespace

void YamlFile::fault(const YAML::Node& node, const std::string& field, const std::string& text) {
  fault_at(node.IsDefined() ? node.Mark() : YAML::Mark::null_mark(), field, text);
}

void YamlFile::fault_at(const YAML::Mark& mark, const std::string& field, const std::string& text) {
  std::string place = file.string();
  if (!mark.is_null()) place.append(":").append(std::to_string(mark.line + 1));
  place += ": ";
  if (!field.empty()) place += field + ": ";
  report.faults.push_back(place + text);
}

void YamlFile::require_no_faults() const {
  if (!report.faults.empty()) throw ConfigError(report.faults);
}

YamlFile open_yaml(const fs::path& file) {
  const std::string content = read_text(file);
  if (!is_text(content)) refuse(file, "is binary; a YAML text file is wanted");
  YamlFile yaml{.file = file, .root = {}, .report = {}};
  try {
    if (!is_one_document(content)) {
      refuse(file, "goes on after the end of its YAML document; one document is wanted");
    }
    yaml.root = YAML::Load(content);
  } catch (const YAML::Exception& error) {
    yaml.fault_at(error.mark, "", "is not valid YAML: " + error.msg);
    yaml.require_no_faults();
  }
  if (!yaml.root.IsMap()) refuse(file, "must be a YAML mapping, lines of 'name: value'");
  return yaml;
}

}  // namespace stillmap
