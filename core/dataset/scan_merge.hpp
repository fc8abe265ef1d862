#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/dataset/scan_dataset.hpp"

namespace stillmap {

/// Index of every scan of a SemanticKITTI sequence by the number in its file's name, which stays
/// when other scans are taken out of the folder. Throws DatasetError when `dataset` is no sequence
/// of numbered .bin files, each number once.
[[nodiscard]] std::map<std::uint32_t, std::size_t> numbered_scans(const ScanDataset& dataset);

/// The file with the labels of a sequence's scan, which need not exist.
[[nodiscard]] std::filesystem::path label_file(const std::filesystem::path& scan_file);

struct MergeOptions {
  /// Numbers in the names of the first and last scan's files.
  std::uint32_t first = 0;
  std::uint32_t last = UINT32_MAX;
  /// Every n-th scan of these.
  std::uint32_t every = 1;
  /// Edge of square tiles, a cloud each [m]; 0: one cloud.
  double tile_m = 0.0;
  /// Replace clouds that are there already.
  bool replace = false;

  /// Every fault in words; empty when the options can be used.
  [[nodiscard]] std::string faults() const;
};

struct MergedClouds {
  std::vector<std::filesystem::path> files;
  std::size_t scans = 0;
  std::uint64_t points = 0;
  /// Points without finite coordinates, which no cloud can hold.
  std::uint64_t left_out = 0;
  /// What the coordinates in the clouds are relative to, in the frame of the sequence's first pose:
  /// whole metres, so that floats keep millimetres far from that pose.
  Eigen::Vector3d origin_map = Eigen::Vector3d::Zero();
};

/// The scan of `poses[index]` as if taken in one instant, by the motion to the next pose (of the
/// last one: to it). One without times for its points, or without a motion, comes back as it is.
[[nodiscard]] Scan at_one_instant(Scan scan, const Trajectory& poses, std::size_t index);

/// Merges the scans of a SemanticKITTI sequence by their poses (paper II-B, fig. 3) into a cloud
/// that can be labelled as a whole. All points of the scans are in it; scans with times for their
/// points are motion-compensated. Tiles are named after their place: city.ply becomes
/// city_x0_y-1.ply. `scan_done(scans so far, scans to do)` returning false ends it with nothing
/// written and no files in the result. Throws DatasetError, std::invalid_argument with
/// `options.faults()`.
[[nodiscard]] MergedClouds merge_scans(
    const ScanDataset& sequence, const std::filesystem::path& cloud, const MergeOptions& options,
    const std::function<bool(std::size_t, std::size_t)>& scan_done = {});

}  // namespace stillmap
