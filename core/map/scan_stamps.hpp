#pragma once

#include <tsl/robin_map.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/lidar/voxel_index.hpp"

namespace stillmap {

/// The stamps of a map's scans, each once: voxels name them by number. A stamp costs 12 bytes; one
/// that was older than another when it came, as after time went backwards, some 50.
class ScanStamps {
 public:
  /// The number of the stamp, which is added where it is new.
  std::uint32_t add(std::int64_t stamp_ns);
  [[nodiscard]] std::int64_t stamp_ns(std::uint32_t number) const { return stamps_ns_[number]; }

  void clear();
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  std::vector<std::int64_t> stamps_ns_;
  /// Numbers of those that were newer than all before, which is to say ascending.
  std::vector<std::uint32_t> ascending_;
  /// Of the others.
  tsl::robin_map<std::int64_t, std::uint32_t, IndexHash> others_;
};

}  // namespace stillmap
