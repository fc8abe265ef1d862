#include "core/dataset/scan_files.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/dataset/binary_file.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/file_stamp.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr std::array scan_endings{".bin", ".pcd", ".ply"};

bool is_scan_file(const fs::path& file, std::string_view ending) {
  std::error_code error;
  return ending_of(file) == ending && fs::is_regular_file(file, error);
}

/// By the stamps that names carry ("12.5" after "12.25"); where one carries none, in natural order.
std::vector<fs::path> sorted(std::vector<fs::path> files) {
  struct Stamped {
    std::int64_t stamp_ns = 0;
    std::size_t place = 0;
  };
  std::ranges::sort(files, [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  std::vector<Stamped> stamped;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const auto stamp_ns = stamp_ns_from_name(files[i].stem().string());
    if (!stamp_ns) return files;
    stamped.push_back({*stamp_ns, i});
  }
  std::ranges::stable_sort(stamped, {}, &Stamped::stamp_ns);
  std::vector<fs::path> ordered;
  for (const Stamped& one : stamped) ordered.push_back(std::move(files[one.place]));
  return ordered;
}

/// The files of one kind, in order: of the kind that the folder has most of, as calibrations and
/// maps may lie beside scans.
std::vector<fs::path> scans_in(const fs::path& folder) {
  std::vector<fs::path> most;
  for (const std::string_view ending : scan_endings) {
    std::vector<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (is_scan_file(entry.path(), ending)) files.push_back(entry.path());
    }
    if (files.size() > most.size()) most = std::move(files);
  }
  return sorted(std::move(most));
}

/// The way out where scans may lie in files of another kind, of which it has most.
std::string other_files_in(const fs::path& folder) {
  std::map<std::string, std::size_t> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    std::error_code error;
    const std::string ending = ending_of(entry.path());
    if (!ending.empty() && fs::is_regular_file(entry.path(), error)) ++files[ending];
  }
  if (files.empty()) return {};
  const auto& [ending, count] =
      *std::ranges::max_element(files, {}, [](const auto& kind) { return kind.second; });
  return ", but " + ending.substr(0, 40) +
         "; of scans in these, write x y z intensity as float32 to .bin files (numpy's tofile)";
}

}  // namespace

std::vector<fs::path> scans_of(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error)) throw DatasetError(path, "no such file or folder; check the path");
  if (!fs::is_directory(path, error)) {
    const bool known = std::ranges::any_of(
        scan_endings, [&](const char* ending) { return is_scan_file(path, ending); });
    if (known) return {path};
    throw DatasetError(path,
                       "is no dataset; give a .bin, .pcd or .ply file, a folder "
                       "of them, or a bag");
  }
  const fs::path velodyne = path / "velodyne";
  const bool sequence = fs::is_directory(velodyne, error);
  const fs::path& folder = sequence ? velodyne : path;
  std::vector<fs::path> files;
  std::string others;
  try {
    files = scans_in(folder);
    if (files.empty()) others = other_files_in(folder);
  } catch (const fs::filesystem_error& fault) {
    throw DatasetError(path, std::string("cannot be read: ") + fault.what());
  }
  if (files.empty()) {
    throw DatasetError(folder, "holds no .bin, .pcd or .ply file" + others +
                                   "; or give the folder that does, or the one above velodyne/");
  }
  return files;
}

std::vector<std::size_t> lines_of(const std::vector<fs::path>& files) {
  std::vector<std::size_t> lines;
  for (const fs::path& file : files) {
    const std::string stem = file.stem().string();
    std::size_t line = 0;
    const auto [end, error] = std::from_chars(stem.data(), stem.data() + stem.size(), line);
    if (error != std::errc{} || end != stem.data() + stem.size()) break;
    lines.push_back(line);
  }
  if (lines.size() == files.size()) return lines;
  lines.resize(files.size());
  for (std::size_t i = 0; i < files.size(); ++i) lines[i] = i;
  return lines;
}

std::vector<std::size_t> lines_in(const fs::path& file, const std::vector<std::size_t>& by_name,
                                  std::size_t present, const std::vector<fs::path>& scans) {
  const auto last = std::ranges::max_element(by_name);
  if (*last < present) return by_name;
  if (present != by_name.size()) {
    const fs::path& scan = scans[static_cast<std::size_t>(last - by_name.begin())];
    throw DatasetError(file, "has " + std::to_string(present) + " lines, but scan " +
                                 scan.stem().string() + " needs line " + std::to_string(*last + 1) +
                                 "; take the file that belongs to this sequence");
  }
  std::vector<std::size_t> in_order(present);
  for (std::size_t i = 0; i < present; ++i) in_order[i] = i;
  return in_order;
}

}  // namespace stillmap
