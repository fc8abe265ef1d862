#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// A lidar of several, and where it sits in the frame that their scans are merged in.
struct PlacedSensor {
  SensorModel sensor;
  Eigen::Isometry3d T_merged_lidar = Eigen::Isometry3d::Identity();
};

/// The frame that scans of several lidars are merged in: base's axes, in the middle of the lidars,
/// where their range images differ least from what each of them sees.
[[nodiscard]] Eigen::Isometry3d merged_frame(std::span<const Eigen::Isometry3d> T_base_lidars);

/// The lidar that would have measured the merged scan: without rings, with a field of view that
/// holds those of all, and without their offsets of elevation, which the parts are rid of.
[[nodiscard]] SensorModel merged_sensor(std::span<const PlacedSensor> sensors);

/// The scan's points in another frame.
void move_points(Scan& scan, const Eigen::Isometry3d& T_new_old);

/// What becomes of labels that some lidars send and others do not.
enum class PartialLabels : std::uint8_t {
  /// They stay; points of the others have none.
  keep,
  /// They are left out, so that one network labels all points: it works on whole scans alone.
  drop,
};

/// Scans of several lidars on one robot as one, at the stamp of the earliest. Every point keeps the
/// time at which it was measured, now from that stamp; rings do not count any more. Points of a
/// lidar without intensity get the mean of the others', which tells nothing. The parts are in the
/// merged frame.
[[nodiscard]] Scan merged_scan(std::vector<Scan> parts,
                               PartialLabels partial_labels = PartialLabels::keep);
/// `sends_labels`: of each part, whether its lidar is known to send labels, so that a scan of
/// points that have no class is no scan without labels.
[[nodiscard]] Scan merged_scan(std::vector<Scan> parts, const std::vector<bool>& sends_labels,
                               PartialLabels partial_labels);

/// Sorts the scans of several lidars into sweeps: scans whose stamps lie less than half a period
/// apart, one of each lidar. Reads no clock: the caller says when a scan arrived.
class SweepMerger {
 public:
  struct Config {
    std::size_t lidars = 2;
    double period_s = 0.1;
    /// Longest wait for a lidar's scan after the first of its sweep has arrived.
    double max_wait_s = 0.1;
    PartialLabels partial_labels = PartialLabels::keep;
  };

  struct Sweep {
    Scan scan;
    /// Lidars that sent nothing in time, but for those that were not due.
    std::vector<std::size_t> missing;
    /// Some lidars sent labels, others send none.
    bool is_partly_labelled = false;
  };

  explicit SweepMerger(const Config& config);

  /// Takes a scan (merged frame) that arrived at `now_s`. Returns how many scans are lost by it:
  /// one that comes after its sweep, or the oldest that waits where too many do.
  [[nodiscard]] std::size_t add(std::size_t lidar, Scan scan, double now_s);

  /// The next sweep that has all its scans or need not wait any longer. A lidar that kept a sweep
  /// waiting in vain is not waited for until it sends again; a slower one is waited for only where
  /// its next scan is due. A sweep far ahead of the last one waits while a lidar that it lacks goes
  /// on sending: one of the clocks is wrong, and sweeps by both in turn could not be mapped.
  [[nodiscard]] std::optional<Sweep> next(double now_s);

  /// Scans of a lidar that wait for those of others.
  [[nodiscard]] std::size_t waiting(std::size_t lidar) const { return lidars_[lidar].size(); }

 private:
  /// More wait only where the clocks of lidars differ by as many sweeps.
  static constexpr std::size_t max_waiting = 8;
  /// A scan that is older than this comes of a clock that was set back, not too late; one that is
  /// farther ahead, of a clock that was set forward.
  static constexpr double max_late_s = 1.0;
  /// A lidar that sent within this time by arrival goes on sending.
  static constexpr double max_pause_s = 1.0;

  struct Waiting {
    Scan scan;
    double arrived_s = 0.0;
  };

  /// When a lidar sent, by its stamps and by arrival.
  struct Rhythm {
    std::optional<std::int64_t> newest_ns{};
    /// The last two times from stamp to stamp; 0: not known.
    std::int64_t step_ns = 0;
    std::int64_t step_before_ns = 0;
    double arrived_s = 0.0;
  };

  /// The lidar whose waiting scan has the earliest stamp.
  [[nodiscard]] std::optional<std::size_t> earliest() const;
  /// Whether the lidar's waiting scan is of the sweep that begins at this stamp.
  [[nodiscard]] bool is_in_sweep(std::size_t lidar, std::int64_t stamp_ns) const;
  /// Whether a scan that it does not have yet may come for the sweep that begins at this stamp.
  [[nodiscard]] bool may_come(std::size_t lidar, std::int64_t stamp_ns) const;
  /// By its rhythm so far, which one lost scan does not change.
  [[nodiscard]] bool is_due(const Rhythm& rhythm, std::int64_t stamp_ns) const;
  /// Whether that sweep waits for a scan that may come.
  [[nodiscard]] bool waits_for(std::size_t lidar, const Waiting& reference, double now_s) const;

  Config config_;
  /// In the order of arrival.
  std::vector<std::deque<Waiting>> lidars_;
  std::vector<bool> is_silent_;
  /// Lidars of which a point had a class, and whose clouds have had a label field since then.
  std::vector<bool> sends_labels_;
  std::vector<Rhythm> rhythms_;
  std::optional<std::int64_t> last_stamp_ns_;
};

}  // namespace stillmap
