#pragma once

#include <bitset>
#include <string>
#include <vector>

#include "core/lidar/semantic_class.hpp"

namespace stillmap::cli {

/// The classes of these names. Throws std::invalid_argument listing the known ones.
[[nodiscard]] std::bitset<semantic_class_count> classes_of(const std::vector<std::string>& names);

}  // namespace stillmap::cli
