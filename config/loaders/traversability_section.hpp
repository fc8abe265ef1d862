#pragma once

#include <filesystem>

#include "config/loaders/server_config.hpp"
#include "config/loaders/yaml_section.hpp"

namespace stillmap {

/// Reads the section `traversability` of a server that keeps a map in tiles of so many metres.
/// A profile's relative file name starts at `folder`.
void read_traversability(YamlSection section, const std::filesystem::path& folder,
                         double tile_size_m, TraversabilityConfig& config);

}  // namespace stillmap
