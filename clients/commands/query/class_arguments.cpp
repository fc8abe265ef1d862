#include "clients/commands/query/class_arguments.hpp"

#include <algorithm>
#include <array>
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

std::bitset<3> motions_of(const std::vector<std::string>& names) {
  static constexpr std::array kinds{"stationary", "semi-static", "highly-dynamic"};
  std::bitset<3> motions;
  for (const std::string& motion : names) {
    const auto kind = std::ranges::find(kinds, motion);
    if (kind == kinds.end()) {
      throw std::invalid_argument("motion '" + motion +
                                  "' is not known; there are: stationary semi-static "
                                  "highly-dynamic");
    }
    motions.set(static_cast<std::size_t>(kind - kinds.begin()));
  }
  return motions;
}

}  // namespace stillmap::cli
