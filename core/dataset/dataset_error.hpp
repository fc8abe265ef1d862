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

/// Poses are those of a camera, and no file tells where on the lidar it is.
class CameraUnknownError : public DatasetError {
 public:
  using DatasetError::DatasetError;
};

/// One that cannot be written: nothing is wrong with what was asked for, the disk may be full.
class DatasetWriteError : public DatasetError {
 public:
  DatasetWriteError(const std::filesystem::path& file, const std::string& fault)
      : DatasetError(file, fault), file_(file) {}
  [[nodiscard]] const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
};

}  // namespace stillmap
