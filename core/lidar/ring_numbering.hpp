#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// Which ring each number of a scan's ring field means, in the field's own order: drivers count
/// from 0 or from 1, and some use every second or fourth number only.
struct RingNumbering {
  /// By number, up to the highest that stands in the field; right for those that stand in it.
  /// Without 255 or 65535 where that is beyond all others and of no measured point: it means no
  /// ring.
  std::vector<std::uint16_t> ring_of_number;
  /// Rings of the lidar as far as the field tells, with those that this scan saw nothing of.
  int rings = 0;
  /// Different numbers in the field.
  int numbers = 0;

  /// 0 of the number that drivers give points that no ring measured.
  [[nodiscard]] std::uint16_t ring_of(std::uint16_t number) const {
    return number < ring_of_number.size() ? ring_of_number[number] : std::uint16_t{0};
  }
  [[nodiscard]] int highest_number() const { return static_cast<int>(ring_of_number.size()) - 1; }
};

/// Of a scan with a ring field. Numbers below the lowest one that stands are rings that saw
/// nothing, as those of a lidar numbered from the top that look into the sky; but where 1 stands
/// and 0 does not, the field counts from 1.
[[nodiscard]] RingNumbering ring_numbering(const Scan& scan);

/// As numbers of this sensor's rings; nothing where they cannot be. Where they can be in more ways
/// than one, as when half of the rings saw nothing, its beams' elevations tell.
[[nodiscard]] std::optional<RingNumbering> ring_numbering(const Scan& scan,
                                                          const SensorModel& sensor);

}  // namespace stillmap
