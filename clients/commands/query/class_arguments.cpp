#include "clients/commands/query/class_arguments.hpp"

#include <optional>
#include <stdexcept>

namespace stillmap::cli {

std::bitset<semantic_class_count> classes_of(const std::vector<std::string>& names) {
  std::bitset<semantic_class_count> classes;
  for (const std::string& class_name : names) {
    const std::optional<SemanticClass> label = class_from_name(class_name);
    if (!label) {
      std::string known;
      for (std::size_t k = 0; k < semantic_class_count; ++k) {
        known.append(" ").append(name(static_cast<SemanticClass>(k)));
      }
      throw std::invalid_argument("class '" + class_name + "' is not known; there are:" + known);
    }
    classes.set(static_cast<std::size_t>(*label));
  }
  return classes;
}

}  // namespace stillmap::cli
