#pragma once

#include "config/loaders/yaml_section.hpp"
#include "core/mapper.hpp"

namespace stillmap {

/// Reads the sections `prepare`, `odometry` and `static_map`.
void read_mapper(YamlSection& file, MapperConfig& mapper);

}  // namespace stillmap
