#pragma once

#include <array>
#include <span>
#include <string_view>

#include "core/lidar/semantic_class.hpp"

namespace stillmap::evaluation {

/// Classes that a user may well take for one thing.
struct ClassGroup {
  std::string_view name;
  std::span<const SemanticClass> classes;
};

/// Drivable ground, other ground, structure, vehicle, person, nature, pole-like: the groups of
/// SemanticKITTI's coarse task, which takes terrain for nature. Each of the 19 classes is in one.
[[nodiscard]] std::array<ClassGroup, 7> coarse_groups();

}  // namespace stillmap::evaluation
