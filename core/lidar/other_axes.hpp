#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <deque>
#include <optional>
#include <span>
#include <string>

#include "core/lidar/scan.hpp"

namespace stillmap {

/// The axis of the points' frame ("-z") that points up from the ground they show, where that is not
/// z: where nothing level lies below, and a quarter of the points on a plane beside or above, 0.3
/// to 4 m away and on all sides of its foot, with nothing beyond, and none opposite, and the lidar
/// looks round that axis. A plane above must also be larger than a room, and the lidar see to its
/// other side. Nothing where no ground is that clear, as between walls or under a ceiling.
[[nodiscard]] std::optional<std::string> other_up_axis(std::span<const Eigen::Vector3f> points);

/// Whether two scans that follow each other see parts of one turn: other directions, but for the
/// edges, as where a simulator ticks more often than its lidar turns, or several lidars take turns.
[[nodiscard]] bool are_parts_of_a_turn(const Scan& first, const Scan& second);

/// The names of coordinates (`input.fields`) that put this axis up.
[[nodiscard]] std::string fields_for_up_axis(const std::string& up);

/// What the scans of a lidar that is running show to be other than they are taken for. Two that
/// follow each other are looked at now and then, and three looks must agree.
class ScanDoubts {
 public:
  struct Look {
    /// The axis that is up where z is not (other_up_axis).
    std::optional<std::string> up{};
    /// Scans are parts of one turn (are_parts_of_a_turn).
    bool are_parts = false;
  };

  /// Of axes nothing is said where it is known how the lidar hangs.
  explicit ScanDoubts(bool is_mount_known) : is_mount_known_(is_mount_known) {}

  /// Takes the next scan. True where what they show is other than it was.
  [[nodiscard]] bool add(const Scan& scan);
  [[nodiscard]] const Look& said() const { return said_; }

 private:
  [[nodiscard]] Look look(const Scan& first, const Scan& second) const;

  bool is_mount_known_;
  std::size_t scans_ = 0;
  /// The one before the next look.
  Scan first_;
  std::deque<Look> looks_;
  Look said_;
};

}  // namespace stillmap
