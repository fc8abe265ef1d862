#pragma once

#include <filesystem>
#include <vector>

namespace stillmap {

/// The folder of a model: `model` itself when it is a path, else the model of that name that comes
/// with Stillmap. Names are looked for in $STILLMAP_MODELS, in share/stillmap/models beside the
/// program's bin, and in config/models of the sources that it was built from. Throws ConfigError
/// that lists these places.
[[nodiscard]] std::filesystem::path find_model(const std::filesystem::path& model);

/// The folders of all models that can be named so, by their names.
[[nodiscard]] std::vector<std::filesystem::path> known_models();

}  // namespace stillmap
