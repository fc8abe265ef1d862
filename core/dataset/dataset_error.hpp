#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

#include "core/process/folder_of_file.hpp"

namespace stillmap {

/// A dataset file that cannot be read or written. what() names the file, the fault and the remedy.
class DatasetError : public std::runtime_error {
 public:
  DatasetError(const std::filesystem::path& file, const std::string& fault)
      : std::runtime_error(file.string() + ": " + fault) {}
};

/// Poses are those of a camera, and no file tells where on the lidar it is.
class CameraUnknownError : public DatasetError {
 public:
  using DatasetError::DatasetError;
};

/// One that cannot be written: nothing is wrong with what was asked for, the disk may be full.
class DatasetWriteError : public DatasetError {
 public:
  DatasetWriteError(const std::filesystem::path& file, const std::string& fault)
      : DatasetError(file, fault), had_folder_(is_folder_there(file)) {}
  /// Whether its folder was there: where not, the name is wrong. It may be gone by now, as that of
  /// a run that failed.
  [[nodiscard]] bool had_folder() const { return had_folder_; }

 private:
  bool had_folder_;
};

}  // namespace stillmap
