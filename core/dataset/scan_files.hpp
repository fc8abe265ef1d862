#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

namespace stillmap {

/// The files of scans of a data set in order: the one that `path` is, those in it, or in its
/// velodyne/; by the stamps in their names, else in natural order. Throws DatasetError.
[[nodiscard]] std::vector<std::filesystem::path> scans_of(const std::filesystem::path& path);

/// Line of each scan in the sequence's text files: the number in its name, so that a cut-out of a
/// sequence keeps its times and poses; the place in the folder where names are not numbers.
[[nodiscard]] std::vector<std::size_t> lines_of(const std::vector<std::filesystem::path>& files);

/// The same, checked: a text file of a sequence, of `present` lines, reaches to all scans. A file
/// that has exactly one line a scan belongs to them in order, whatever the names say. Throws
/// DatasetError.
[[nodiscard]] std::vector<std::size_t> lines_in(const std::filesystem::path& file,
                                                const std::vector<std::size_t>& by_name,
                                                std::size_t present,
                                                const std::vector<std::filesystem::path>& scans);

}  // namespace stillmap
