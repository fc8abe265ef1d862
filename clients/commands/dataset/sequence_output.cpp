#include "clients/commands/dataset/sequence_output.hpp"

#include <algorithm>
#include <array>
#include <stdexcept>

namespace stillmap::cli {

void prepare_sequence_folder(const std::filesystem::path& folder, bool force) {
  constexpr std::array parts{"velodyne",  "labels",       "labels.bak",
                             "rings",     "time_offsets", "calib.txt",
                             "times.txt", "poses.txt",    "poses_lidar.txt"};
  if (!std::filesystem::exists(folder / parts.front())) return;
  if (!force) {
    throw std::invalid_argument(folder.string() +
                                " holds a sequence already; name another folder, or replace it "
                                "and its labels with --force");
  }
  for (const char* part : parts) std::filesystem::remove_all(folder / part);
}

std::vector<std::uint32_t> labels_of_all_points(const Scan& scan,
                                                std::span<const SemanticClass> classes_of_usable,
                                                const PrepareConfig& prepare) {
  std::vector<std::uint32_t> raw_labels(scan.size());
  const std::vector<std::uint32_t> usable = usable_points(scan, prepare);
  if (usable.size() != classes_of_usable.size()) return raw_labels;
  for (std::size_t i = 0; i < usable.size(); ++i) {
    raw_labels[usable[i]] = semantic_kitti_id(classes_of_usable[i]);
  }
  return raw_labels;
}

void SequenceOutput::add(const Scan& scan, std::vector<std::uint32_t> raw_labels,
                         const Eigen::Isometry3d& T_map_lidar) {
  raw_labels.resize(scan.size());
  writer_.add(scan, raw_labels, T_map_lidar);
  summary_.scans += 1;
  summary_.points += scan.size();
  summary_.labelled_points += static_cast<std::uint64_t>(
      std::ranges::count_if(raw_labels, [](std::uint32_t raw) { return (raw & 0xFFFFU) != 0; }));
}

ExportSummary SequenceOutput::finish() const {
  writer_.finish();
  return summary_;
}

}  // namespace stillmap::cli
