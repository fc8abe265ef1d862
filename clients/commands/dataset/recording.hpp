#pragma once

#include <string>

#include "core/dataset/scan_dataset.hpp"

namespace stillmap::cli {

/// A dataset or bag, as dds::open_sequence(); says on standard error what of it cannot be read.
/// Throws DatasetError.
[[nodiscard]] ScanDataset open_recording(const std::string& path, const std::string& topic);

}  // namespace stillmap::cli
