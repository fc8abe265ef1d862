#pragma once

namespace stillmap {

/// What of a scan counts for the occupancy map.
struct ScanUpdateOptions {
  /// Its rays clear what they pass, if it is one of those that do.
  bool clear_free_space = true;
  /// Points of no known class are solid; false where they may be movers that came into sight.
  bool unknown_is_solid = true;
};

}  // namespace stillmap
