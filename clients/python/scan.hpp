#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "clients/python/arrays.hpp"
#include "core/dataset/scan_source.hpp"

namespace stillmap::python {

/// points_lidar (n, 3) [m]; of the others, where they are given, one for each point. Throws
/// std::invalid_argument for other shapes, for rings and labels that are no whole numbers, and for
/// rings and classes that do not exist.
[[nodiscard]] DatasetFrame frame_from_arrays(const InArray<float>& points_lidar,
                                             std::int64_t stamp_ns,
                                             const std::optional<InArray<float>>& intensity,
                                             const std::optional<InArray<float>>& time_offset_s,
                                             const std::optional<py::object>& ring,
                                             const std::optional<py::object>& labels);

/// Stamps, angular velocities, accelerations.
[[nodiscard]] py::tuple imu_arrays(const std::vector<ImuSample>& samples);

}  // namespace stillmap::python
