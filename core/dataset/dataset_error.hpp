#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace stillmap {

/// A recording that cannot be read or written. The text names the file, what is wrong with it and
/// the way out.
class DatasetError : public std::runtime_error {
 public:
  DatasetError(const std::filesystem::path& file, const std::string& fault)
      : std::runtime_error(file.string() + ": " + fault) {}
};

}  // namespace stillmap
