#include "clients/commands/arguments/scan_range.hpp"

#include <algorithm>
#include <stdexcept>

namespace stillmap::cli {

std::size_t ScanRange::end(const ScanDataset& dataset) const {
  const std::size_t scans = dataset.size();
  if (scans == 0) throw std::invalid_argument("the data set has no scan");
  if (first >= scans) {
    throw std::invalid_argument("the data set has " + std::to_string(scans) + " scans, 0 to " +
                                std::to_string(scans - 1) + "; --start is " +
                                std::to_string(first));
  }
  if (count == 0) throw std::invalid_argument("--scans 0 asks for no scan; 1 is the least");
  return first + std::min(count, scans - first);
}

void add_range_options(CommandHandle command, ScanRange& range) {
  command.option("--start", range.first, "Number of the first scan");
  command.option("--scans,--count", range.count, "Take as many scans at most");
  command.flag("--strict", range.strict, "Stop at the first damaged file instead of skipping it");
}

}  // namespace stillmap::cli
