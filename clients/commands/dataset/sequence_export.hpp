#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "clients/commands/arguments/scan_range.hpp"
#include "core/dataset/kitti_sequence_writer.hpp"
#include "core/lidar/prepare.hpp"
#include "core/mapper.hpp"

namespace stillmap::cli {

/// Prepares the folder for a new sequence. Throws std::invalid_argument when `folder` holds a
/// part of one already and `force` is not set; with `force`, removes the files of that sequence and
/// nothing else, and throws as well where one of the `sources` of the new one is among them,
/// whatever links lead there.
void prepare_sequence_folder(const std::filesystem::path& folder, bool force,
                             std::span<const std::filesystem::path> sources = {});

/// Counts of an export.
struct ExportSummary {
  std::size_t scans = 0;
  std::uint64_t points = 0;
  /// Points that have a class by the data set or the label source.
  std::uint64_t labelled_points = 0;
  /// As Segmenter::name(); "stream" where scans brought their labels, whatever the segmenter.
  std::string label_source;
  std::size_t imu_samples = 0;
  std::size_t gnss_fixes = 0;
  /// A fault of some scans, and their number.
  struct Remark {
    std::size_t scans = 0;
    std::string text;
  };
  std::vector<Remark> remarks;
  bool stopped = false;
};

/// SemanticKITTI ids for all points of `scan` from the classes of its usable points
/// (drop_unusable_points), 0 for the others. All 0 when the numbers of points do not fit.
[[nodiscard]] std::vector<std::uint32_t> labels_of_all_points(
    const Scan& scan, std::span<const SemanticClass> classes_of_usable,
    const PrepareConfig& prepare);

/// Writes scans to a sequence and counts them.
class SequenceOutput {
 public:
  explicit SequenceOutput(const std::filesystem::path& folder) : writer_(folder) {}

  /// As KittiSequenceWriter::add; without labels, all points are unlabeled.
  void add(const Scan& scan, std::vector<std::uint32_t> raw_labels,
           const Eigen::Isometry3d& T_map_lidar);
  /// Writes the text files; returns the counts.
  [[nodiscard]] ExportSummary finish() const;

  [[nodiscard]] std::size_t scans() const { return summary_.scans; }

 private:
  KittiSequenceWriter writer_;
  ExportSummary summary_;
};

/// Writes a data set as a SemanticKITTI sequence: every point of every scan unchanged, poses from
/// our odometry, the samples of its IMU and GNSS receiver, and for labels the data set's own where
/// a scan has them, else those of `labels`, with `drive_votes` after DriveVotes. `scan_done` as for
/// map_dataset. Throws DatasetError.
[[nodiscard]] ExportSummary export_sequence(const ScanDataset& dataset, const ScanRange& range,
                                            const MapperConfig& config,
                                            std::unique_ptr<Segmenter> labels, bool drive_votes,
                                            const std::filesystem::path& folder,
                                            const ScanDone& scan_done,
                                            const ScanSkipped& scan_skipped);

}  // namespace stillmap::cli
