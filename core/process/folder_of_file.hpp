#pragma once

#include <filesystem>
#include <system_error>

namespace stillmap {

/// Whether the folder that the file lies in, or is to lie in, is there now.
[[nodiscard]] inline bool is_folder_there(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.parent_path();
  std::error_code unknown;
  return folder.empty() || std::filesystem::is_directory(folder, unknown);
}

}  // namespace stillmap
