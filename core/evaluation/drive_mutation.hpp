#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap::evaluation {

/// What goes wrong in a drive. Of a drive of n scans:
enum class DriveMutation {
  none,
  /// One second is missing after a third, three seconds after two thirds.
  drop,
  /// The lidar is carried off: scans 0 to n/2, then 3n/4 to n, then n/4 to n/2, evenly stamped.
  teleport,
  /// Up to 20 scans of another place stand in for the drive's own after n/2.
  other_place,
  /// From n/3 to 2n/3 the left half of the view is covered.
  cover,
  /// From n/3 to 2n/3 all is covered but 20 degrees ahead.
  cover_all,
  /// Every stamp is off by up to 45 ms; their order holds.
  jitter,
  /// One stamp in twenty is 90 ms late.
  late,
};

/// By its name as above. Throws std::invalid_argument naming all.
[[nodiscard]] DriveMutation drive_mutation(const std::string& name);

/// One scan of a mutated drive.
struct MutatedScan {
  /// Number in the drive, or in the other place.
  std::size_t index = 0;
  bool of_other_place = false;
  std::int64_t stamp_ns = 0;
  /// Azimuths that are not covered, anticlockwise from straight ahead [deg].
  double visible_from_deg = -180.0;
  double visible_to_deg = 180.0;
};

/// The scans of a drive with these stamps, in the order in which they come. `other_scans` is the
/// number of scans that there are of another place. The same arguments give the same scans.
[[nodiscard]] std::vector<MutatedScan> mutate_drive(DriveMutation mutation,
                                                    std::span<const std::int64_t> stamps_ns,
                                                    std::size_t other_scans = 0);

/// The scan with the stamp and the points that the mutation leaves it.
[[nodiscard]] Scan mutate_scan(Scan scan, const MutatedScan& mutated);

}  // namespace stillmap::evaluation
