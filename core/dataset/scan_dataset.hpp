#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/dataset/bin_layout.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/dataset/kitti_lidar.hpp"
#include "core/dataset/scan_source.hpp"
#include "core/lidar/label_kind.hpp"
#include "core/lidar/point_fields.hpp"
#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/lidar/trajectory.hpp"
#include "core/lidar/turn_joiner.hpp"

namespace stillmap {

/// A dataset on disk, read scan by scan:
/// - a SemanticKITTI sequence: velodyne/*.bin, and where present labels/*.label, times.txt,
///   calib.txt and poses.txt (camera frame) or poses_lidar.txt (lidar frame), and our own
///   time_offsets/, rings/ and axes.txt (see KittiSequenceWriter);
/// - a folder of .bin (KITTI's or nuScenes': see BinLayout), .pcd or .ply files, of the kind that
///   it has most of, in the order of the stamps in their names, else in natural order ("2" before
///   "10");
/// - a single such file;
/// - any ScanSource, such as a bag's topic.
/// Intensity is scaled to 0..1, by one factor for all that some of them decide. Scans of KITTI's
/// own lidar are corrected (see KittiLidar), unless they come with files of our own.
class ScanDataset {
 public:
  /// Throws DatasetError when there is no scan to be found, or none of some from all over it can be
  /// read, or .bin files are of a layout that is not known.
  /// `fields`: the names of what .pcd and .ply files have of a point; of .bin files, whose
  /// coordinates count as x, y and z, only the axes.
  /// `label_kind`: what the numbers in its labels are; nothing: SemanticKITTI's, and label_census()
  /// tells whether they look like them.
  explicit ScanDataset(const std::filesystem::path& path, std::optional<LabelKind> label_kind = {},
                       PointFieldNames fields = {});

  /// Throws DatasetError when there is no scan, or none of some from all over it can be read.
  explicit ScanDataset(std::shared_ptr<const ScanSource> source,
                       std::optional<LabelKind> label_kind = {});

  /// Makes a scan of the clouds of each turn where these are parts of turns: `clouds_per_turn` of
  /// them, unless some were lost by the stamps; 1 leaves each a scan, TurnJoiner::automatic finds
  /// out from clouds of five places. Those of several frames stay as they are. Scans then have
  /// other numbers. Without stamps ten turns a second are assumed.
  void join_turns(std::size_t clouds_per_turn = TurnJoiner::automatic);
  /// 1: each cloud is a scan.
  [[nodiscard]] std::size_t clouds_per_turn() const { return clouds_per_turn_; }

  [[nodiscard]] std::size_t size() const { return turns_.empty() ? files_.size() : turns_.size(); }
  /// Of a joined turn: that of the first part.
  [[nodiscard]] const std::filesystem::path& file(std::size_t i) const {
    return files_.at(first_part(i));
  }

  /// What was understood or taken for granted, in words: from which fields of a typical scan its
  /// intensity, times and rings are; that files without a stamp in their names follow each other
  /// by 0.1 s; that its coordinates can be no metres; what remarks_on_scans() says. Empty where
  /// nothing is open. Reads scans.
  [[nodiscard]] std::vector<std::string> remarks(bool is_mount_known = false) const;

  /// Every file that it is read from: those of the scans, what lies beside them, and the text files
  /// of a sequence. For scans of a source: the names that it gives them.
  [[nodiscard]] std::vector<std::filesystem::path> all_files() const;

  /// From times.txt (see read_kitti_times()), else from the files' names (see
  /// stamp_ns_from_name()), else 0.1 s apart from 0.
  [[nodiscard]] std::int64_t stamp_ns(std::size_t i) const { return stamps_ns_.at(first_part(i)); }

  /// Whether scans come with labels: any of some from all over the dataset that can be read. Labels
  /// without one known class, as where PCL's PointXYZL was saved unfilled, are none.
  [[nodiscard]] bool has_labels() const { return has_labels_; }
  /// Whether others come without: any of the same, or one that has no file in labels/.
  [[nodiscard]] bool lacks_labels() const;
  /// The labels of those scans, where nobody told of which kind they are; else none.
  [[nodiscard]] const LabelCensus& label_census() const { return label_census_; }
  /// Whether this one does. Throws as read() does.
  [[nodiscard]] bool has_labels(std::size_t i) const;

  /// Throws DatasetError when a file of the scan is damaged; the others can still be read.
  [[nodiscard]] DatasetFrame read(std::size_t i) const;
  /// The same without the corrections of kitti_lidar(): points as they are in the file.
  [[nodiscard]] DatasetFrame read_uncorrected(std::size_t i) const;

  /// True poses, one a scan, in the lidar frame of the pose file's first line, along the axes that
  /// the names of x, y and z put its points to; nothing without a pose file. Throws DatasetError
  /// when it is damaged, or has too few lines; before that CameraUnknownError when it is in the
  /// camera's frame and no calib.txt tells where that is.
  [[nodiscard]] std::optional<Trajectory> truth() const;

  /// Samples of an IMU by the scans' clock: imu.csv or imu.txt beside velodyne/ or the scans' files
  /// (see read_imu_file), or those of the source; empty without any. Throws DatasetError when the
  /// file is damaged.
  [[nodiscard]] std::vector<ImuSample> imu() const;

  /// Fixes of a GNSS receiver by the scans' clock: gnss.csv beside velodyne/ or the scans' files
  /// (see read_gnss_csv), or those of the source; empty without any. Throws DatasetError when the
  /// file is damaged.
  [[nodiscard]] std::vector<GnssFix> gnss() const;

  /// A guess from the kind of file and the rings or elevations of a scan of usual size.
  [[nodiscard]] SensorModel suggested_sensor() const { return suggested_sensor_; }

  /// What read() corrects, where the files are recognised as those of KITTI's lidar.
  [[nodiscard]] const std::optional<KittiLidar>& kitti_lidar() const { return kitti_lidar_; }

 private:
  [[nodiscard]] std::size_t first_part(std::size_t i) const {
    return turns_.empty() ? i : turns_.at(i);
  }
  /// One after the last.
  [[nodiscard]] std::size_t end_of_parts(std::size_t i) const {
    return i + 1 < size() ? first_part(i + 1) : files_.size();
  }
  /// How many clouds make a turn, by those of some places.
  [[nodiscard]] std::size_t find_clouds_per_turn() const;

  [[nodiscard]] DatasetFrame read_unscaled(std::size_t i) const;
  /// With raw labels as they are in the files or messages.
  [[nodiscard]] DatasetFrame read_as_recorded(std::size_t i) const;
  /// Of the files or messages, not of the scans.
  [[nodiscard]] DatasetFrame read_part(std::size_t part) const;
  [[nodiscard]] std::filesystem::path beside(std::size_t part, const char* folder,
                                             const char* extension) const;

  /// A few scans from all over the dataset.
  [[nodiscard]] std::vector<std::size_t> sample() const;
  /// Throws DatasetError where names of x, y and z make no axes of a .bin file's.
  void settle_axes();
  /// Of .bin files; throws DatasetError (see bin_layout_of()).
  [[nodiscard]] BinLayout find_bin_layout() const;
  /// Takes scale, sensor and whether there are labels from them.
  void learn_from_sample();
  [[nodiscard]] std::optional<KittiLidar> find_kitti_lidar() const;
  /// What was taken for granted of them; empty where that is nothing.
  [[nodiscard]] std::string remark_on_times() const;
  /// Time between scans; 0.1 where the stamps say nothing [s].
  [[nodiscard]] double period_s() const;

  /// Where the scans come from, when they are not in files of their own.
  std::shared_ptr<const ScanSource> source_;
  /// Where velodyne/ lies; empty for other datasets.
  std::filesystem::path sequence_;
  std::vector<std::filesystem::path> files_;
  /// Line of each scan in times.txt and the pose files.
  std::vector<std::size_t> lines_;
  std::vector<std::int64_t> stamps_ns_;
  /// Of each scan the first of its files; empty where each is one.
  std::vector<std::size_t> turns_;
  std::size_t clouds_per_turn_ = 1;
  std::optional<LabelKind> label_kind_;
  PointFieldNames fields_;
  /// Of a typical scan.
  std::string format_;
  /// Of times.txt; `none` where stamps are made up.
  TimesUnit times_unit_ = TimesUnit::seconds;
  LabelCensus label_census_;
  float intensity_scale_ = 1.0F;
  bool has_labels_ = false;
  bool lacks_labels_ = false;
  /// Its writer said so, and names of x, y and z count no more.
  bool are_axes_ours_ = false;
  BinLayout bin_layout_ = BinLayout::kitti;
  /// Half of the points of a typical scan lie farther away than any lidar sees.
  bool is_too_large_ = false;
  SensorModel suggested_sensor_;
  std::optional<KittiLidar> kitti_lidar_;
};

}  // namespace stillmap
