#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace stillmap {

/// A model that cannot be used; `what()` names the file and the fault.
class ModelError : public std::runtime_error {
 public:
  ModelError(const std::filesystem::path& file, const std::string& fault)
      : std::runtime_error(file.string() + ": " + fault) {}
};

/// A valid model with a layer that this engine does not support; another engine may.
class UnsupportedModel : public ModelError {
  using ModelError::ModelError;
};

}  // namespace stillmap
