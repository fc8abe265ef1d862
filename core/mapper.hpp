#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/inertial/inertial_tracker.hpp"
#include "core/label_synchronizer.hpp"
#include "core/lendable_map.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/prepare.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/lidar/trajectory.hpp"
#include "core/map/map_correction.hpp"
#include "core/map/static_map.hpp"
#include "core/odometry/odometry.hpp"
#include "core/odometry/odometry_state.hpp"
#include "core/segmentation_pipeline.hpp"

namespace stillmap {

struct MapperConfig {
  SensorModel sensor;
  PrepareConfig prepare;
  OdometryConfig odometry;
  StaticMapConfig static_map;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// What became of one scan.
struct MappedScan {
  OdometryResult odometry;
  LabelProvenance label_provenance = LabelProvenance::none;
  /// The prepared scan (lidar frame) with labels and motion of every point.
  LabelledScan labelled;
  /// Points without a class may be movers that came into sight: they make no voxels.
  bool unlabelled_may_move = false;
  /// The same pose in the odometry's own frame, which no correction of the map moves.
  Eigen::Isometry3d T_odom_lidar = Eigen::Isometry3d::Identity();
  /// So many scans before it have waited, and enter the map with it: see MapEntry.
  std::size_t entered_before = 0;
  /// The first one in the map since Mapper::relocate(): the way from those before it is not known.
  bool begins_elsewhere = false;
};

/// Why a scan was not mapped.
struct ScanRejection {
  /// Counter's name in the status: "empty", "out_of_order", "time_jump", "too_few_points".
  std::string counter;
  std::string reason;
};

/// What an IMU did to level the start of a map.
struct Levelling {
  /// The lidar leans by so much [rad].
  double tilt_rad = 0.0;
  /// Why the map is not levelled; empty where it is.
  std::string fault{};
  /// Counts the mapper's maps, from 0.
  std::uint32_t map = 0;
};

/// Decides whether a scan's stamp can be believed. A stamp far in the future, or before the last
/// one, is a fault until the scans after it go on from there: then the clock was set.
class ScanClock {
 public:
  /// `last_ns` is the stamp of the last scan that was accepted.
  [[nodiscard]] bool accepts(std::int64_t stamp_ns, std::int64_t last_ns);
  /// The first of the scans on whose going on the last doubtful one was accepted.
  [[nodiscard]] std::int64_t first_doubtful_ns() const { return first_doubtful_ns_; }

 private:
  static constexpr std::int64_t max_step_ns = 60'000'000'000;
  static constexpr int scans_after_jump = 3;
  /// Stamps may come again and again for a moment, when a sender starts over.
  static constexpr int scans_after_step_back = 10;

  std::int64_t first_doubtful_ns_ = 0;
  std::int64_t doubtful_ns_ = 0;
  int doubtful_scans_ = 0;
};

/// Called when a stage of the pipeline has ended, with its name: "prepare", "segment", "odometry",
/// "static_map". The caller owns the clock.
using StageListener = std::function<void(std::string_view stage)>;

/// Callbacks of Mapper::process(); each may be empty.
struct MapperListeners {
  StageListener stage_ended;
  /// The pose is known; the scan is not in the static map yet.
  std::function<void(std::int64_t stamp_ns, const OdometryResult& odometry)> pose_found;
  /// A prepared scan with its times, in the order of the stages before it is registered, and the
  /// labels of its own, if any; only where Mapper::hand_out_scans() asked for it.
  std::function<void(const Scan& scan, const PointLabels& labels)> scan_prepared{};
};

/// A static map that resumed a stored one.
struct ResumedMap {
  /// Takes time in proportion to the map's tiles.
  [[nodiscard]] static ResumedMap of(StaticMap map);
  /// The same, ready for a scan that is expected near this position: its tiles there are in memory,
  /// and the odometry's local map is made.
  [[nodiscard]] static ResumedMap of(StaticMap map, const Eigen::Vector3d& position_map,
                                     const MapperConfig& config);

  StaticMap map;
  /// Ascending. The tiles themselves would keep their voxels in memory, evicted or not.
  std::vector<TileId> tiles;
  struct Begin {
    Eigen::Vector3d position_map;
    PriorMap prior;
  };
  std::optional<Begin> begin;
};

/// The pipeline of a scan: prepare, label, deskew, register, insert into the static map. One thread
/// calls it; nothing in it waits, reads a clock or owns a thread. With a Segmenter (or a
/// BlockingSegmenter) the result depends on the scans alone.
class Mapper {
 public:
  /// Throws std::invalid_argument with `config.faults()`.
  Mapper(const MapperConfig& config, std::unique_ptr<Segmenter> segmenter,
         MapperListeners listeners = {});
  /// With labels that may come late: see LabelSynchronizer.
  Mapper(const MapperConfig& config, std::unique_ptr<SegmentationPipeline> segmentation,
         MapperListeners listeners = {});

  /// Maps one scan. `T_map_lidar_prior` replaces the constant-velocity prediction. A scan that
  /// cannot be mapped leaves the mapper as it was and returns nothing; `last_rejection()` says why.
  [[nodiscard]] std::optional<MappedScan> process(
      Scan raw_scan, const std::optional<Eigen::Isometry3d>& T_map_lidar_prior = std::nullopt);

  /// A sample of the IMU, before the scans whose sweeps end after it. Without samples, or where
  /// they are wrong, scans are mapped by what the scans themselves say.
  void add(const ImuSample& sample) { inertial_.add(sample); }
  [[nodiscard]] const InertialTracker& inertial() const { return inertial_; }
  /// How the IMU levelled the start of the map; nothing where it was not asked.
  [[nodiscard]] const std::optional<Levelling>& levelling() const { return levelling_; }

  [[nodiscard]] const ScanRejection& last_rejection() const { return last_rejection_; }
  /// The poses of all scans, or of the last ones.
  [[nodiscard]] const Trajectory& trajectory() const { return trajectory_; }
  /// Keeps at least this many of the last poses, and at most twice as many.
  void limit_trajectory(std::size_t poses) { max_poses_ = poses; }
  [[nodiscard]] std::string label_source() const { return label_synchronizer_.name(); }
  /// How the lidar of the next scans sits on its robot, for the label source (see Segmenter).
  void set_mount(const Eigen::Isometry3d& T_base_lidar) {
    label_synchronizer_.set_mount(T_base_lidar);
  }
  /// Maps begin with this frame of the robot at their origin, as it stands: level where an IMU
  /// tells which way is up. Not where the first scan has a prior.
  void begin_maps_at(const Eigen::Isometry3d& T_base_lidar) { T_base_lidar_ = T_base_lidar; }
  [[nodiscard]] std::shared_ptr<const MapSnapshot> map_snapshot() {
    return static_map_.map().view();
  }

  /// The next scans are of another lidar at the same place on the robot, or of the same one by
  /// another description, with labels from another source: poses and map go on. `config` differs
  /// in `sensor`, but for its IMU, and `prepare` alone; throws std::invalid_argument with its
  /// faults, and nothing has changed then. Scans whose labels are still to come stay out of the
  /// map.
  void use_sensor(const MapperConfig& config, std::unique_ptr<SegmentationPipeline> segmentation);

  /// Whether a scan was registered since the map began or the lidar was relocated: before, nothing
  /// but its prior tells where it is.
  [[nodiscard]] bool is_placed() const { return is_placed_; }
  /// Whether the next scan begins a map, which an IMU may level: one that was found anywhere in a
  /// map begins none.
  [[nodiscard]] bool begins_map() const {
    return !is_placed_ && resumed_tiles_.empty() && scans_to_confirm_ == 0;
  }
  /// Whether the next scans are given to MapperListeners::scan_prepared.
  void hand_out_scans(bool is_wanted) { hands_out_scans_ = is_wanted; }
  /// The lidar is somewhere else in the map than it seemed to be: the next scan is looked for
  /// within some metres of its prior, which it needs, and no scan enters the map before as many in
  /// a row as this fitted there. `followed` has followed the lidar until now, in any frame: its
  /// velocity is kept.
  void relocate(Odometry followed, int confirming_scans = 5);

  /// Whether scans that have waited (MapEntry) enter the map by insert_confirmed_scans(), not with
  /// the scan that confirms them: they may be hundreds.
  void keep_confirmed_scans(bool are_kept) { keeps_confirmed_ = are_kept; }
  [[nodiscard]] std::size_t confirmed_scans() const { return static_map_.confirmed_scans(); }
  /// The oldest of them enter the map, which must not be lent.
  void insert_confirmed_scans(std::size_t max_scans = std::numeric_limits<std::size_t>::max()) {
    static_map_.insert_confirmed(max_scans);
  }

  /// Whether scans register against what a resumed map has near them only where that was added
  /// already. Where odometry has drifted away from it, it would be torn between both.
  void hold_resumed_map(bool is_held) { is_resumed_map_held_ = is_held; }

  /// What is stored of it, what of it is in memory, and what was removed from it.
  [[nodiscard]] StaticMap& static_map() { return static_map_.map(); }

  /// Lends the static map to another thread, which corrects it while scans go on to be registered.
  /// Until it is reclaimed only process() and add() may be called, and what tells of poses. Scans
  /// are kept meanwhile; they and those after them enter the map when insert_kept_scans() is
  /// called.
  [[nodiscard]] StaticMap& lend_static_map() { return static_map_.lend(); }
  /// Poses of this map were wrong by that, and the static map was corrected: the poses so far and
  /// the scans that were kept follow, and all that come by the last of them. Odometry goes on in
  /// its own frame and never hears of it. Null: nothing was moved.
  void reclaim_static_map(const MapCorrection* correction);
  [[nodiscard]] std::size_t kept_scans() const { return static_map_.kept_scans(); }
  /// The oldest of them enter the map, which must not be lent.
  void insert_kept_scans(std::size_t max_scans = std::numeric_limits<std::size_t>::max()) {
    static_map_.insert_kept(max_scans);
  }

  /// Forgets poses and takes over a stored static map; the next scans extend it. The next scan is
  /// looked for in it, round its prior or the map's origin, and all register against what is stored
  /// near them. Throws std::invalid_argument for voxels or tiles of another size than configured,
  /// and is then as it was.
  void resume(const MapSnapshot& view, const TileEvidenceMap& tile_evidence = {});
  /// After that, where the next scan follows soon on those that the map was made of: the lidar
  /// moved so between their last two poses, and goes on as it did. Without this the first scan of a
  /// lidar that turns while it moves is taken for one that stood, and a fast one is not found.
  /// Poses are those of its body. A velocity that is known stays.
  void go_on_from(const StampedPose& before_last, const StampedPose& last,
                  const Eigen::Isometry3d& T_body_lidar = Eigen::Isometry3d::Identity()) {
    odometry_.go_on_from({before_last.stamp_ns, before_last.T_map_lidar * T_body_lidar},
                         {last.stamp_ns, last.T_map_lidar * T_body_lidar});
  }
  /// The same with a static map that resumed a stored one already, elsewhere: cannot fail, and
  /// takes as long for a large map as for a small one. Returns the map until now, for another
  /// thread to free.
  [[nodiscard]] ResumedMap resume(ResumedMap prepared);

  /// Forgets poses and maps; the next scan starts map `map_id` at the origin.
  void reset(std::uint64_t map_id);

 private:
  /// Fewer points give no pose.
  static constexpr std::size_t min_usable_points = 100;

  /// All but the static map.
  void clear_scan_state();
  /// Adds the points of a resumed map near this position to the odometry's local map, unless they
  /// were added when the lidar was close by.
  void add_prior_map_near(const Eigen::Vector3d& position_map);
  [[nodiscard]] bool accepts(const Scan& scan);
  /// Before a scan that was accepted although its stamp is not after the last one.
  void follow_clock(std::int64_t stamp_ns);
  [[nodiscard]] bool has_enough_points(const Scan& scan);
  /// The prior, or for the first scan of a new map the attitude that the IMU tells: map's z is up.
  [[nodiscard]] std::optional<Eigen::Isometry3d> levelled(
      const std::optional<Eigen::Isometry3d>& T_map_lidar_prior, const Scan& scan,
      const SweepTimes& sweep);
  /// What speaks against an IMU that says this is up; empty: nothing does.
  [[nodiscard]] std::string fault_of_up(const Eigen::Vector3d& up_lidar, const Scan& scan) const;
  [[nodiscard]] std::optional<Eigen::Isometry3d> in_odometry_frame(
      const std::optional<Eigen::Isometry3d>& T_map_lidar) const;
  /// What odometry says in its own frame, in the map.
  void move_to_map(OdometryResult& result) const;
  void remember(const StampedPose& pose);
  /// Rotation by the IMU from the last pose on.
  [[nodiscard]] std::optional<InertialMotion> inertial_motion(std::int64_t stamp_ns,
                                                              const SweepTimes& sweep);
  void teach_inertial(std::int64_t middle_ns, const Odometry::Step& step);
  /// By its entry, with those that wait. Returns how many of these entered.
  std::size_t enter_map(const MappedScan& mapped, const LabelSynchronizer::Labels& labels);
  /// Where the lidar was relocated, a scan is no part of the map until enough of them fitted.
  /// True for the first one that is.
  [[nodiscard]] bool confirm_relocation(OdometryResult& result);
  void end_stage(std::string_view stage) const;

  MapperConfig config_;
  MapperListeners listeners_;
  LabelSynchronizer label_synchronizer_;
  InertialTracker inertial_;
  std::optional<Levelling> levelling_;
  /// Of maps to begin; nothing: the lidar is at their origin.
  std::optional<Eigen::Isometry3d> T_base_lidar_;
  std::uint32_t maps_begun_ = 0;
  /// Of the last scan that was registered, in the middle of its sweep; in the odometry's frame.
  std::optional<StampedPose> last_middle_;
  Odometry odometry_;
  /// Corrections of the map so far.
  Eigen::Isometry3d T_map_odom_ = Eigen::Isometry3d::Identity();
  LendableMap static_map_;
  /// Tiles of a resumed map, where those near the lidar were last reloaded, and where their points
  /// were last added to the odometry's local map.
  std::vector<TileId> resumed_tiles_;
  std::optional<Eigen::Vector3d> tiles_reloaded_at_map_;
  std::optional<Eigen::Vector3d> prior_map_added_at_map_;
  /// For the first scan of a resumed map.
  std::optional<ResumedMap::Begin> begin_;
  bool keeps_confirmed_ = false;
  bool is_resumed_map_held_ = false;
  bool is_placed_ = false;
  /// In a row.
  int lost_scans_ = 0;
  bool hands_out_scans_ = false;
  /// Scans that are to fit after a relocation, and how many of them; 0: none.
  int scans_to_confirm_ = 0;
  int confirming_scans_ = 0;
  Trajectory trajectory_;
  std::size_t max_poses_ = std::numeric_limits<std::size_t>::max() / 2;
  ScanClock clock_;
  ScanRejection last_rejection_;
};

}  // namespace stillmap
