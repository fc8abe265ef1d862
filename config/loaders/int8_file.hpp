#pragma once

#include <filesystem>
#include <optional>

#include "config/loaders/config_error.hpp"
#include "core/segmentation/int8_calibration.hpp"

namespace stillmap {

/// Reads int8.yaml of a model folder; nothing when there is none. Throws ConfigError with every
/// fault.
[[nodiscard]] std::optional<Int8Calibration> load_int8_calibration(
    const std::filesystem::path& file);

/// Writes it so that it reads back the same. Throws ConfigError when it cannot be written.
void save_int8_calibration(const Int8Calibration& calibration, const std::filesystem::path& file);

}  // namespace stillmap
