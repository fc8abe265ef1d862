#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>

namespace stillmap {

struct ScatterResult {
  std::uint64_t points_in_cloud = 0;
  /// Scans that have a point in the cloud.
  std::size_t scans_in_cloud = 0;
  /// Points of those scans that are not in the cloud: they keep their labels.
  std::uint64_t points_missing = 0;
  std::uint64_t labels_changed = 0;
  std::size_t scans_changed = 0;
  /// Changed labels that had an instance and have none now.
  std::uint64_t instances_dropped = 0;
};

/// Writes the labels of an edited cloud (see MergedCloudReader) back to the scans of the sequence
/// that it was merged from; a point is known by its scan's number and its index. In a cloud without
/// the field `instance`, a label of 65536 or more carries its instance as .label files do, and a
/// smaller one keeps the point's instance unless its class changed.
///
/// The whole cloud is read and checked first: an error leaves every label as it was. A scan's
/// .label is replaced in one step, and only when a label of it changed; before the first change, it
/// is copied to labels.bak/, where later calls leave it alone. `points_read(so far, total)` is
/// called now and then. Throws DatasetError naming the file and the point.
[[nodiscard]] ScatterResult scatter_labels(
    const std::filesystem::path& cloud, const std::filesystem::path& sequence,
    const std::function<void(std::uint64_t, std::uint64_t)>& points_read = {});

}  // namespace stillmap
