#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap {

/// Directions round the lidar's third axis, anticlockwise [degrees].
struct ViewedArc {
  double begin_deg = 0.0;
  /// 0 to 360.
  double width_deg = 0.0;
};

/// The smallest arc that holds all directions in which something was measured, to a degree; nothing
/// of a cloud with hardly a point.
[[nodiscard]] std::optional<ViewedArc> viewed_arc(std::span<const Eigen::Vector3f> points_lidar);

/// What tells whether clouds are parts of turns.
struct CloudView {
  std::int64_t stamp_ns = 0;
  std::optional<ViewedArc> arc{};
};

enum class TurnVerdict : std::uint8_t {
  /// More clouds are needed.
  open,
  /// Each cloud shows what the last one showed, or all round: a turn, or a lidar that looks one
  /// way.
  whole,
  /// Each goes on where the last one ended, twice round.
  parts,
};

struct TurnJudgement {
  TurnVerdict verdict = TurnVerdict::open;
  /// Of `parts`: so many clouds show all directions.
  std::size_t clouds_per_turn = 1;
};

/// What clouds that follow each other are. Those of a lidar that looks one way alone are never
/// parts, nor are turns of more than a second: nothing moves steadily for so long.
[[nodiscard]] TurnJudgement judge_turns(std::span<const CloudView> clouds);

/// Finds out how many clouds make a turn, from cloud to cloud.
class TurnRecognition {
 public:
  /// Takes the next cloud.
  void learn(const CloudView& view);
  /// 1: each is a turn, or of a lidar that looks one way; 0: not known yet.
  [[nodiscard]] std::size_t clouds_per_turn() const { return clouds_per_turn_; }
  /// Whether there is a cloud that the next one is compared with.
  [[nodiscard]] bool is_comparing() const { return !run_.empty(); }

 private:
  /// More are no turns that anybody publishes in parts.
  static constexpr std::size_t max_run = 200;
  /// A cloud or two of parts may look like the last one where little is seen.
  static constexpr int views_to_withdraw = 4;
  static constexpr std::size_t max_steps = 9;

  /// Whether clouds got lost before this one, which tells nothing then of the last.
  [[nodiscard]] bool comes_late(std::int64_t stamp_ns);
  /// Whether so many clouds were lost, or looked like none, that nobody waits for more to tell.
  [[nodiscard]] bool is_open_long(std::int64_t stamp_ns) const;

  std::size_t clouds_per_turn_ = 0;
  /// Of the last judgement of parts.
  std::size_t last_found_ = 0;
  /// Views since the last judgement.
  std::vector<CloudView> run_;
  std::optional<std::int64_t> last_ns_;
  /// The last times from cloud to cloud.
  std::vector<std::int64_t> steps_ns_;
  /// Since when clouds were compared without a judgement.
  std::int64_t open_since_ns_ = 0;
  bool is_open_ = false;
  int same_views_ = 0;
};

/// Tells clouds of one turn from those of the next, by number, and where some were lost, by their
/// stamps.
class TurnCounter {
 public:
  explicit TurnCounter(std::size_t clouds_per_turn) : clouds_per_turn_(clouds_per_turn) {}

  /// Takes the next cloud. True where a turn begins with it.
  [[nodiscard]] bool begins_turn(std::int64_t stamp_ns);
  /// Whether the last cloud ended its turn.
  [[nodiscard]] bool is_complete() const { return filled_ >= clouds_per_turn_; }

 private:
  static constexpr std::size_t max_steps = 9;

  /// Clouds since the last one by its stamp, lost ones too; 0: that one is no earlier, or of
  /// another turn in any case.
  [[nodiscard]] std::size_t clouds_since(std::int64_t stamp_ns);

  std::size_t clouds_per_turn_;
  /// Clouds of this turn, lost ones too.
  std::size_t filled_ = 0;
  std::optional<std::int64_t> last_ns_;
  /// The last times from cloud to cloud.
  std::vector<std::int64_t> steps_ns_;
};

/// Parts of a turn as one scan, at the stamp of the first. Every point keeps its time; points of a
/// cloud without times are of its stamp. Not empty.
[[nodiscard]] Scan joined_turn(std::vector<Scan> parts);

}  // namespace stillmap
