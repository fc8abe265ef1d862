#pragma once

#include "core/odometry/registration.hpp"

namespace stillmap {

/// register_features, and where the scan shows a shift by few residuals or none, again from where a
/// wider kernel leads without the weights of thin planes: those few grow with every scan that keeps
/// its prediction, until the kernel leaves out just them. The direct result stays where features
/// and points together speak more for it. Not of the paper's own method, nor without a kernel, nor
/// by edges and planes of single rings, which gain nothing by it, nor by sparse rings, which
/// unlabelled traffic would then take along.
[[nodiscard]] OdometryResult register_with_faint_shifts(
    const FeatureSets& features, const LocalMap& map,
    const Eigen::Isometry3d& T_map_lidar_predicted, const OdometryConfig& config,
    const SweepCorrection& sweep_correction = {});

/// A good pose of which the scan shows one shift by few residuals is degenerate where it would lie
/// as well a little to either side: then they are noise. Planes through a few points of a smooth
/// wall lean this way and that, and as many of them as stand across it look like a wall across; but
/// they are found anywhere along it. Not where those few tell it (witnesses_tell), nor of the
/// paper's own method.
[[nodiscard]] OdometryResult doubted_where_shift_fits(OdometryResult found,
                                                      const FeatureSets& features,
                                                      const LocalMap& map,
                                                      const OdometryConfig& config);

}  // namespace stillmap
