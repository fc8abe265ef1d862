#include "core/dataset/scan_remarks.hpp"

#include <cstddef>
#include <optional>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/lidar/other_axes.hpp"

namespace stillmap {

std::vector<std::string> remarks_on_scans(const ScanDataset& dataset, bool is_mount_known) {
  // Three scans and those after them, from all over the recording.
  constexpr std::size_t wanted = 3;
  std::size_t pairs = 0, parts = 0;
  std::optional<std::string> up;
  for (std::size_t k = 1; k <= wanted; ++k) {
    const std::size_t i = k * dataset.size() / (wanted + 1);
    if (i + 1 >= dataset.size()) continue;
    try {
      const Scan scan = dataset.read_uncorrected(i).scan;
      parts += are_parts_of_a_turn(scan, dataset.read_uncorrected(i + 1).scan) ? 1 : 0;
      if (is_mount_known) {
        ++pairs;
        continue;
      }
      const auto up_here = other_up_axis(scan.points_lidar);
      up = pairs++ == 0 || up == up_here ? up_here : std::nullopt;
    } catch (const DatasetError&) {
      // Whoever reads that scan is told.
      continue;
    }
  }
  std::vector<std::string> remarks;
  if (pairs < 2) return remarks;
  if (parts == pairs)
    remarks.push_back(
        "scans that follow each other look into other directions, as parts of one turn, or as "
        "several lidars on one topic: parts are joined by 'stillmap map' and by a server "
        "(input.clouds_per_turn); of half turns that are left as they are every second one is "
        "lost, and poses may be metres off");
  if (up)
    remarks.push_back(
        "by the ground that these points seem to show, unless that is a ceiling or "
        "a wall, " +
        *up +
        " is up, while x is taken for ahead, y for left and z for up; 'input: "
        "{fields: ...}' in a --config file puts other axes right (" +
        fields_for_up_axis(*up) + "), --mount says how a lidar hangs");
  return remarks;
}

}  // namespace stillmap
