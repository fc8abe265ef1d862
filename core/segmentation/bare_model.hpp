#pragma once

#include <filesystem>

#include "core/segmentation/model_description.hpp"

namespace stillmap {

/// A description that lets a network file be run which has none, as for measuring its speed: the
/// size that the file declares or else rows x columns, no normalisation, outputs without a meaning.
/// Throws ModelError.
[[nodiscard]] ModelDescription describe_bare_network(const std::filesystem::path& network_file,
                                                     int rows, int columns);

}  // namespace stillmap
