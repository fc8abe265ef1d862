#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "core/inertial/imu_sample.hpp"

namespace stillmap {

/// Samples of an IMU, a line each; lines that begin with '#' are left out. A .csv is in EuRoC's
/// layout: stamp [ns], angular velocity x y z [rad/s], acceleration x y z [m/s^2]; any other file
/// has stamp [s], acceleration x y z, angular velocity x y z, with blanks between them.
/// Throws DatasetError that names the line.
[[nodiscard]] std::vector<ImuSample> read_imu_file(const std::filesystem::path& file);

/// Writes a .csv that read_imu_file() reads back. Throws DatasetError.
void write_imu_csv(const std::filesystem::path& file, std::span<const ImuSample> samples);

/// imu.csv or imu.txt in a folder; empty when it has neither.
[[nodiscard]] std::filesystem::path imu_file_in(const std::filesystem::path& folder);

}  // namespace stillmap
