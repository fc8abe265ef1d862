#include "clients/commands/mapping/earlier_map.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/map/query/tile_reader.hpp"

namespace stillmap::cli {

EarlierMap::EarlierMap(std::filesystem::path file, const std::optional<StaticMapConfig>& sizes)
    : file_(std::move(file)), copy_(file_), saved_(copy_.load()) {
  if (saved_.view.tiles.empty()) {
    throw std::invalid_argument(file_.string() +
                                " is an empty map: nothing can be recognised in it; name "
                                "another one");
  }
  try {
    if (sizes) check_sizes(saved_.view, *sizes);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(file_.string() + ": " + error.what());
  }
  index_ = std::make_shared<const PlaceIndex>(std::make_shared<const MapSnapshot>(saved_.view),
                                              saved_.trajectory, std::make_shared<TileReader>());
}

std::string EarlierMap::identity() const {
  return std::filesystem::weakly_canonical(file_).string() + " (id " +
         std::to_string(saved_.view.map_id) + ", version " + std::to_string(saved_.view.version) +
         ")";
}

std::int64_t EarlierMap::clock_offset_ns(std::int64_t first_stamp_ns) const {
  constexpr std::int64_t between_sessions_ns = 1'000'000'000;
  if (saved_.trajectory.empty()) return 0;
  // Of several runs, whose clocks may have begun anew.
  const std::int64_t last_ns =
      std::ranges::max(saved_.trajectory, {}, &StampedPose::stamp_ns).stamp_ns;
  return first_stamp_ns > last_ns ? 0 : last_ns + between_sessions_ns - first_stamp_ns;
}

std::vector<MapSession> EarlierMap::sessions() const {
  try {
    return read_map_sessions(copy_.path());
  } catch (const MapFileError& error) {
    throw error_of(file_, copy_.path(), error);
  }
}

void EarlierMap::copy_to(const std::filesystem::path& file) const {
  open_map_file(copy_.path())->copy_to(file);
}

}  // namespace stillmap::cli
