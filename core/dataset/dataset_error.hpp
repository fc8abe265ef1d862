#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace stillmap {

/// A dataset file that cannot be read or written. what() names the file, the fault and the remedy.
class DatasetError : public std::runtime_error {
 public:
  DatasetError(const std::filesystem::path& file, const std::string& fault)
      : std::runtime_error(file.string() + ": " + fault) {}
};

}  // namespace stillmap
