#include "config/loaders/label_map.hpp"

#include <charconv>
#include <optional>
#include <vector>

#include "config/loaders/class_names.hpp"
#include "config/loaders/yaml_section.hpp"

namespace stillmap {
namespace {

std::optional<std::uint16_t> raw_label(const std::string& text) {
  std::uint16_t value = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || stop != end) return std::nullopt;
  return value;
}

LabelMap::Entry read_entry(YamlSection section) {
  LabelMap::Entry entry;
  section.require({"class"});
  section.text("name", entry.name);
  read_class(section, "class", entry.label);
  section.choice<Motion>("motion", entry.motion,
                         {{"stationary", Motion::stationary},
                          {"semi_static", Motion::semi_static},
                          {"highly_dynamic", Motion::highly_dynamic}});
  return entry;
}

void read_entries(YamlSection section, LabelMap& map) {
  for (const std::string& number : section.names()) {
    const std::optional<std::uint16_t> raw = raw_label(number);
    if (!raw) {
      section.fault(number, "is not a label; a whole number from 0 to 65535");
      continue;
    }
    if (map.entries.contains(*raw)) section.fault(number, "is mapped twice");
    map.entries[*raw] = read_entry(section.section(number));
  }
  if (map.entries.empty()) section.faults("maps no label; wanted are lines of 'number: {...}'");
}

}  // namespace

SemanticClass LabelMap::class_of(std::uint16_t raw_label) const {
  const auto found = entries.find(raw_label);
  return found == entries.end() ? SemanticClass::unlabeled : found->second.label;
}

LabelMap load_label_map(const std::filesystem::path& file) {
  YamlFile yaml = open_yaml(file);
  LabelMap map;
  {
    YamlSection root(yaml);
    root.text("name", map.name);
    read_entries(root.section("labels"), map);
  }
  yaml.require_no_faults();
  return map;
}

}  // namespace stillmap
