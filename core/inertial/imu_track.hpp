#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <deque>
#include <optional>

#include "core/inertial/imu_sample.hpp"

namespace stillmap {

/// What becomes of a sample.
enum class ImuSampleFate {
  taken,
  /// NaN or infinity, or a rate or acceleration that no IMU measures.
  not_usable,
  /// Not after the last one.
  out_of_order,
};

/// An IMU's mean measurement while it moved steadily.
struct SteadyMean {
  Eigen::Vector3d angular_velocity_imu = Eigen::Vector3d::Zero();
  /// Unit vector against gravity.
  Eigen::Vector3d up_imu = Eigen::Vector3d::UnitZ();
  /// Of the mean specific force [m/s^2].
  double acceleration_m_s2 = 0.0;
  /// From its first sample to its last.
  double duration_s = 0.0;
  /// It said the same again and again: a driver that hangs, or a simulator without noise at rest.
  bool is_frozen = false;
};

/// The last samples of an IMU. Times are those of its stamps.
class ImuTrack {
 public:
  /// Longest time between two samples over which rates are interpolated.
  static constexpr std::int64_t max_gap_ns = 50'000'000;

  /// After many samples that are not after the last one the clock was set: the track starts over.
  [[nodiscard]] ImuSampleFate add(const ImuSample& sample);

  /// Takes directions of the IMU at `to_ns` to those at `from_ns`, by its rates less `bias_imu`
  /// [rad/s]. Nothing where samples are missing, where all or the rates of turn say the same again
  /// and again, or where one of these is beyond what the gyro measures.
  [[nodiscard]] std::optional<Eigen::Quaterniond> rotation(std::int64_t from_ns, std::int64_t to_ns,
                                                           const Eigen::Vector3d& bias_imu) const;

  /// Rate of turn [rad/s]; nothing where samples are missing.
  [[nodiscard]] std::optional<Eigen::Vector3d> rate_at(std::int64_t time_ns) const;

  /// The stamp of the last sample.
  [[nodiscard]] std::optional<std::int64_t> newest_ns() const {
    return entries_.empty() ? std::nullopt : std::optional(entries_.back().sample.stamp_ns);
  }

  /// Nothing where the IMU was shaken or turned between these times, or has too few samples.
  [[nodiscard]] std::optional<SteadyMean> steady_mean(std::int64_t from_ns,
                                                      std::int64_t to_ns) const;

 private:
  struct Entry {
    ImuSample sample;
    /// Without glitches of single samples [rad/s].
    Eigen::Vector3d rate_imu = Eigen::Vector3d::Zero();
    /// Samples in a row up to this one that say the same.
    int repetitions = 0;
    /// The same of the rate about each axis.
    Eigen::Array3i rate_repetitions = Eigen::Array3i::Zero();
    /// Whether the rate last grew or shrank (1, -1), and samples since it did the other.
    Eigen::Array3i rate_direction = Eigen::Array3i::Zero();
    Eigen::Array3i since_reversal = Eigen::Array3i::Zero();
    /// How often it went to and fro between few samples, as noise does, without a repetition.
    Eigen::Array3i noisy_reversals = Eigen::Array3i::Zero();
  };
  using Entries = std::deque<Entry>;

  /// Counts of an entry how often what the one before it says is repeated, and what noise it has.
  static void compare(const Entry& last, Entry& entry);
  [[nodiscard]] static bool tells_rate(const Entry& entry);
  [[nodiscard]] static Eigen::Vector3d interpolated_rate(const Entry& a, const Entry& b,
                                                         std::int64_t time_ns);
  /// The rate of an entry or, where single samples there are far from all round them, theirs.
  [[nodiscard]] Eigen::Vector3d rate_without_glitch(std::ptrdiff_t index) const;

  /// The last entry that is not after `time_ns`, where one follows it closely.
  [[nodiscard]] Entries::const_iterator before(std::int64_t time_ns) const;

  Entries entries_;
  int out_of_order_ = 0;
};

/// Rotation vector of q, of at most pi [rad].
[[nodiscard]] Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& q);

/// Inverse of rotation_vector.
[[nodiscard]] Eigen::Quaterniond rotation_by(const Eigen::Vector3d& rotation_vector);

}  // namespace stillmap
