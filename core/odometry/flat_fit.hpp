#pragma once

#include "core/odometry/registration.hpp"

namespace stillmap {

/// Whether scans have lately lain as well on the local map beside their poses as where these are.
/// Then they do not tell the pose, however many of their residuals see every direction: planes
/// through grass, crops, or snow in the air lean every way, and hold the lidar wherever
/// registration began. One scan alone may be chance.
class FlatFit {
 public:
  /// `found`, but degenerate instead of good where this scan and those before lie as well beside,
  /// unless what of this one sees the shift lies clearly worse there (witnesses_tell). It says
  /// nothing of a lost one, nor of one by features of single rings. Not of the paper's own method.
  [[nodiscard]] OdometryResult doubted(OdometryResult found, const FeatureSets& features,
                                       const LocalMap& map, const OdometryConfig& config);

 private:
  /// Running mean of what the fit loses to the side, 0..1; negative where it lies better there. It
  /// begins above the limit: the first scan alone may be chance.
  double mean_lost_ = 0.04;
  /// Scans since it was asked for last.
  int unasked_ = 0;
};

}  // namespace stillmap
