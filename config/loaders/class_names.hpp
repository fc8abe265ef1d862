#pragma once

#include <string>

#include "config/loaders/yaml_section.hpp"
#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// Reads a field that holds the name of a class ("other-vehicle").
void read_class(YamlSection& section, const std::string& field, SemanticClass& label);

}  // namespace stillmap
