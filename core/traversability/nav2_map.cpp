#include "core/traversability/nav2_map.hpp"

#include <fstream>
#include <stdexcept>
#include <vector>

#include "core/process/file_beside.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

// With p = (255 - shade) / 255, map_server reads a pixel as occupied above occupied_thresh, free
// below free_thresh, else unknown. Unknown cells (205) have p = 0.196, so free_thresh is not above
// that.
constexpr char occupied_shade = '\x00';
constexpr char unknown_shade = '\xCD';
constexpr char free_shade = '\xFE';
constexpr const char* thresholds = "occupied_thresh: 0.65\nfree_thresh: 0.196\n";

char shade_of(std::int8_t value) {
  if (value == occupancy_unknown) return unknown_shade;
  return value == occupancy_lethal ? occupied_shade : free_shade;
}

[[noreturn]] void throw_unwritten(const fs::path& file) {
  throw std::runtime_error(file.string() + ": cannot be written; check folder and space left");
}

void write_file(const fs::path& file, const std::string& content, const FileBeside& beside) {
  std::ofstream out(beside.path(), std::ios::binary | std::ios::trunc);
  out.write(content.data(), static_cast<std::streamsize>(content.size()));
  out.close();
  if (!out) throw_unwritten(file);
}

std::string image_of(const OccupancyGrid& grid) {
  std::string image =
      "P5\n" + std::to_string(grid.width) + " " + std::to_string(grid.height) + "\n255\n";
  // The image's first row has the highest y.
  for (std::uint32_t row = grid.height; row-- > 0;) {
    for (std::uint32_t x = 0; x < grid.width; ++x) image.push_back(shade_of(grid.at(x, row)));
  }
  return image;
}

std::string description_of(const OccupancyGrid& grid) {
  std::string text = "image: map.pgm\nmode: trinary\nresolution: ";
  text.append(std::to_string(grid.resolution_m)).append("\norigin: [");
  text.append(std::to_string(grid.origin_map.x())).append(", ");
  text.append(std::to_string(grid.origin_map.y())).append(", 0]\nnegate: 0\n");
  return text.append(thresholds);
}

}  // namespace

void write_nav2_map(const fs::path& folder, const OccupancyGrid& grid) {
  if (grid.status != TraversabilityStatus::ok)
    throw std::invalid_argument("no map to write: " + grid.reason);
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": cannot be made: " + error.message());
  const fs::path image = folder / "map.pgm";
  const fs::path description = folder / "map.yaml";
  FileBeside image_beside(image);
  FileBeside description_beside(description);
  write_file(image, image_of(grid), image_beside);
  write_file(description, description_of(grid), description_beside);
  // Once both are whole: they belong together.
  if (image_beside.put_in_place()) throw_unwritten(image);
  if (description_beside.put_in_place()) throw_unwritten(description);
}

}  // namespace stillmap
