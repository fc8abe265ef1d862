#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap {

class ScanDataset;

/// The axis of the points' frame ("-z") that points up from the ground they show, where that is not
/// z: where nothing level lies below, and a quarter of the points on a plane beside or above, 0.3
/// to 4 m away and on all sides of its foot, with nothing beyond, and none opposite, and the lidar
/// looks round that axis. A plane above must also be larger than a room, and the lidar see to its
/// other side. Nothing where no ground is that clear, as between walls or under a ceiling.
[[nodiscard]] std::optional<std::string> other_up_axis(std::span<const Eigen::Vector3f> points);

/// Whether two scans that follow each other see parts of one turn: other directions, but for the
/// edges, as where a simulator ticks more often than its lidar turns, or several lidars take turns.
[[nodiscard]] bool are_parts_of_a_turn(const Scan& first, const Scan& second);

/// What some of a recording's scans show to be other than they are taken for, in words, with the
/// way out. Scans that cannot be read tell nothing. Of axes nothing is said where it is known how
/// the lidar hangs.
[[nodiscard]] std::vector<std::string> remarks_on_scans(const ScanDataset& dataset,
                                                        bool is_mount_known);

}  // namespace stillmap
