#include "config/loaders/class_names.hpp"

#include <vector>

namespace stillmap {

void read_class(YamlSection& section, const std::string& field, SemanticClass& label) {
  std::vector<YamlSection::Choice<SemanticClass>> classes;
  for (std::size_t i = 0; i < semantic_class_count; ++i) {
    const auto one = static_cast<SemanticClass>(i);
    classes.push_back({std::string(name(one)), one});
  }
  section.choice(field, label, classes);
}

}  // namespace stillmap
