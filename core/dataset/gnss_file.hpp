#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "core/geodesy/gnss_fix.hpp"

namespace stillmap {

/// Fixes of a GNSS receiver, a line each; lines that begin with '#' are left out: stamp [ns],
/// latitude, longitude [deg], altitude above the ellipsoid [m], standard deviations east, north and
/// up [m], with commas between them. Throws DatasetError that names the line.
[[nodiscard]] std::vector<GnssFix> read_gnss_csv(const std::filesystem::path& file);

/// Writes what read_gnss_csv() reads back. Throws DatasetError.
void write_gnss_csv(const std::filesystem::path& file, std::span<const GnssFix> fixes);

}  // namespace stillmap
