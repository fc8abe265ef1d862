#pragma once

#include <string>
#include <vector>

namespace stillmap {

class ScanDataset;

/// What some of a recording's scans show to be other than they are taken for, in words, with the
/// way out. Scans that cannot be read tell nothing. Of axes nothing is said where it is known how
/// the lidar hangs.
[[nodiscard]] std::vector<std::string> remarks_on_scans(const ScanDataset& dataset,
                                                        bool is_mount_known);

}  // namespace stillmap
