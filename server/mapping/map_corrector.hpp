#pragma once

#include <cstddef>
#include <functional>
#include <future>
#include <memory>
#include <optional>

#include "core/map/map_correction.hpp"
#include "core/map/tile.hpp"
#include "core/mapper.hpp"

namespace stillmap::server {

/// Corrects the mapper's static map, and makes the view of it, in a thread of its own: the scans
/// that come meanwhile are registered, and enter the map when it is done. Only the mapping thread
/// calls it.
class MapCorrector {
 public:
  /// The mapper must outlive it, and what is corrected is the one map it has: see
  /// Mapper::lend_static_map().
  MapCorrector(Mapper& mapper, std::size_t limit_bytes)
      : mapper_(mapper), limit_bytes_(limit_bytes) {
    mapper_.keep_confirmed_scans(true);
  }

  /// Must not be running.
  void begin(MapCorrection correction);
  /// Until its result was taken.
  [[nodiscard]] bool is_running() const { return work_.valid(); }

  struct Result {
    MapCorrection correction;
    /// Nothing where it was refused: see StaticMap::correct.
    std::optional<CorrectedMap> corrected;
    std::shared_ptr<const MapSnapshot> view;
    double ms = 0.0;
  };
  /// What a correction led to, once it has ended; its mapper goes on with the corrected map. Waits
  /// for the end where that is wanted, or the mapper would keep too many scans. Throws what the
  /// correction threw.
  [[nodiscard]] std::optional<Result> take(bool waits);
  /// Some of the scans that were kept enter the map, more than come with each that does, then some
  /// of those that were confirmed; all while there is time. True once none is kept: then the
  /// mapper's map is nobody else's.
  [[nodiscard]] bool insert_kept(const std::function<bool()>& has_time);

 private:
  /// A scan takes some 5 MB.
  static constexpr std::size_t max_kept_scans = 20;

  Mapper& mapper_;
  std::size_t limit_bytes_;
  std::future<Result> work_;
};

}  // namespace stillmap::server
