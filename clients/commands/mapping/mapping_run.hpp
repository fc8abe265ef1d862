#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/commands/arguments/mount_arguments.hpp"
#include "clients/commands/arguments/scan_range.hpp"
#include "clients/commands/mapping/earlier_map.hpp"
#include "clients/commands/mapping/loop_correction.hpp"
#include "clients/commands/mapping/run_file.hpp"
#include "clients/commands/stage_stopwatch.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/evaluation/moving_score.hpp"
#include "core/mapper.hpp"

namespace stillmap::cli {

struct MappingResult {
  /// Of the body; corrected where loops were closed.
  Trajectory trajectory;
  /// Of the body as odometry had them, and the map by them where poses were corrected.
  Trajectory odometry;
  std::shared_ptr<const MapSnapshot> odometry_view;
  /// Nothing where loops were not looked for.
  std::optional<LoopReport> loops;
  /// Of a drive that was put onto an earlier map: poses and view are that map's, the evidence is
  /// that of the tiles that changed.
  std::optional<SessionReport> session;
  /// Index in the data set of each pose of the trajectory.
  std::vector<std::size_t> scan_of_pose;
  std::shared_ptr<const MapSnapshot> view;
  /// Evidence of the tiles beyond the published view.
  TileEvidenceMap tile_evidence;
  std::string label_source;
  std::vector<SkippedScan> skipped;
  std::map<OdometryHealth, std::size_t> health;
  /// Numbers of the scans from which on the lidar, which was lost, was followed again where it was
  /// found in the whole map.
  std::vector<std::size_t> found_again_at;
  /// What became of the samples of the data set's IMU.
  InertialCounts imu;
  /// Nothing where no IMU was asked.
  std::optional<Levelling> levelling;
  /// Against the moving ids of the data set, where it has labels.
  evaluation::MovingScore moving;
  std::vector<StageDurations> stages;
  double seconds = 0.0;
  /// Index of the scan that a resumed run went on with.
  std::optional<std::size_t> resumed_at_scan;
  /// A signal ended it early.
  bool stopped = false;
};

/// What is mapped, and how.
struct MappingTask {
  const ScanDataset& dataset;
  ScanRange range;
  MapperConfig config;
  MappedBody body;
  /// Nothing: loops stay open.
  std::optional<LoopOptions> loops = std::nullopt;
  /// The map that the drive is put onto by closing loops; may be null.
  const EarlierMap* earlier_map = nullptr;
};

/// Whom a run tells how far it is; each may be empty.
struct MappingListeners {
  ScanDone scan_done;
  ScanSkipped scan_skipped;
  /// Called while the map is made again by corrected poses; returning false ends the run, which
  /// then is as if it had been stopped before that.
  std::function<bool(std::size_t done, std::size_t total)> scan_moved;
};

/// Maps a data set in this process. The run goes on from what `run_file` holds, and its state is
/// saved there from time to time; what is reported of scans, but poses and map, is of the resumed
/// part alone. Loops are closed when all scans are mapped: poses and map are corrected then. What
/// was stopped has poses and map as odometry made them. Throws what reading and saving throw, and
/// MapNotRecognized.
[[nodiscard]] MappingResult map_dataset(const MappingTask& task, std::unique_ptr<Segmenter> labels,
                                        RunFile& run_file, const MappingListeners& listeners);

}  // namespace stillmap::cli
