#include "core/dataset/numbered_scans.hpp"

#include <charconv>
#include <string>
#include <system_error>

#include "core/dataset/dataset_error.hpp"

namespace stillmap {

std::map<std::uint32_t, std::size_t> numbered_scans(const ScanDataset& dataset) {
  std::map<std::uint32_t, std::size_t> index_of;
  for (std::size_t i = 0; i < dataset.size(); ++i) {
    const std::filesystem::path& file = dataset.file(i);
    const std::string stem = file.stem().string();
    std::uint32_t number = 0;
    const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
    const bool numbered = error == std::errc{} && end == stem.data() + stem.size();
    if (!numbered || file.extension() != ".bin" || file.parent_path().filename() != "velodyne" ||
        !index_of.emplace(number, i).second) {
      throw DatasetError(file,
                         "is not a scan of a SemanticKITTI sequence (velodyne/NNNNNN.bin); make "
                         "one of this recording with 'stillmap dataset export'");
    }
  }
  return index_of;
}

std::filesystem::path label_file(const std::filesystem::path& scan_file) {
  return scan_file.parent_path().parent_path() / "labels" / (scan_file.stem().string() + ".label");
}

}  // namespace stillmap
