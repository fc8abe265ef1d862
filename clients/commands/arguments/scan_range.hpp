#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

#include "clients/terminal/command_line.hpp"
#include "core/dataset/scan_dataset.hpp"

namespace stillmap::cli {

/// Which scans of a data set a command goes through, and what it does about damaged ones.
struct ScanRange {
  std::size_t first = 0;
  /// As many as this, or as there are.
  std::size_t count = SIZE_MAX;
  /// A damaged file ends the run instead of being skipped.
  bool strict = false;

  /// One past the last scan. Throws std::invalid_argument when no scan is in the range.
  [[nodiscard]] std::size_t end(const ScanDataset& dataset) const;
};

/// Adds --start, --scans and --strict.
void add_range_options(CommandHandle command, ScanRange& range);

/// A scan that was skipped, and why.
struct SkippedScan {
  std::size_t index = 0;
  std::string counter;
  std::string reason;
};

/// Called after every scan with the number of scans seen; returning false ends the run.
using ScanDone = std::function<bool(std::size_t seen)>;
/// Called for every scan that is skipped.
using ScanSkipped = std::function<void(const SkippedScan&)>;

}  // namespace stillmap::cli
