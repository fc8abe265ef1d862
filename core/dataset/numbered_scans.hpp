#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>

#include "core/dataset/scan_dataset.hpp"

namespace stillmap {

/// Index of every scan of a SemanticKITTI sequence by the number in its file's name, which stays
/// when other scans are taken out of the folder. Throws DatasetError when `dataset` is no sequence
/// of numbered .bin files, each number once.
[[nodiscard]] std::map<std::uint32_t, std::size_t> numbered_scans(const ScanDataset& dataset);

/// The file with the labels of a sequence's scan, which need not exist.
[[nodiscard]] std::filesystem::path label_file(const std::filesystem::path& scan_file);

}  // namespace stillmap
