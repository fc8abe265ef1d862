// A number that says how the bytes come (an octomap_msgs/Octomap over DDS, a .bt or .ot file, or
// the tree alone), then they; what is read is asked about and encoded again.

#include <stdexcept>

#include "core/occupancy/occupancy_map.hpp"
#include "core/occupancy/octomap_data.hpp"
#include "core/occupancy/octomap_file.hpp"
#include "idl/conversions/occupancy.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/cdr.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/memory_folder.hpp"
#include "tests/fuzz/street_map.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace octomap_inputs {
namespace {

enum Kind : std::uint8_t { message, binary_file, full_file, binary_tree, full_tree, kinds };

std::optional<OctomapData> read(Kind kind, ByteSource& source) {
  const auto& folder = MemoryFolder::of_this_process();
  if (kind == message) {
    const auto octomap = from_cdr<octomap_msgs::msg::Octomap>(source.rest());
    return octomap ? wire::from_octomap(*octomap) : std::nullopt;
  }
  if (kind == binary_file) return read_octomap_file(folder.file("octree.bt", source.rest()));
  if (kind == full_file) return read_octomap_file(folder.file("octree.ot", source.rest()));
  const double resolution_m = source.value<double>();
  return OctomapData{kind == binary_tree ? OctomapEncoding::binary : OctomapEncoding::full,
                     resolution_m, text_of(source.rest())};
}

void use(const OctomapData& data) {
  const OctomapCheck check = check_octomap(data);
  const OccupancyMap map(data);
  require(check.fault.empty(), "damaged data is refused");
  static_cast<void>(map.at_point(Eigen::Vector3d(0.1, 0.1, 0.1)));
  static_cast<void>(map.in_box({Eigen::Vector3d(-1, -1, -1), Eigen::Vector3d(1, 1, 1)}, 10));
  static_cast<void>(map.along_ray({.origin_map = Eigen::Vector3d::Zero(),
                                   .direction_map = Eigen::Vector3d(1.0, 0.5, 0.1),
                                   .max_range_m = 20.0,
                                   .ignore_unknown = true}));
  const OctomapData again = map.encode(OctomapEncoding::full);
  require(check_octomap(again).fault.empty(), "what is encoded can be read");
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const auto kind = static_cast<Kind>(source.byte() % kinds);
  try {
    if (const auto data = read(kind, source)) use(*data);
  } catch (const MapFileError&) {
  } catch (const std::invalid_argument&) {
  }
}

std::string tree_bytes(const OctomapData& data) {
  std::string bytes;
  append_value(bytes, data.resolution_m);
  return bytes.append(data.bytes);
}

std::string file_bytes(const char* name, const OctomapData& data) {
  const auto file = MemoryFolder::of_this_process().path(name);
  write_octomap_file(file, data);
  return content_of(file);
}

std::vector<Seed> seeds() {
  MapSnapshot view = small_street().view;
  view.tiles = {view.tiles.front()};
  OccupancyMap map{OccupancyConfig{}};
  map.insert(view);
  const OctomapData binary = map.encode(OctomapEncoding::binary);
  const OctomapData full = map.encode(OctomapEncoding::full);
  return {{"message", with_choice(message, to_cdr(wire::to_octomap(binary, 5, "map")))},
          {"bt", with_choice(binary_file, file_bytes("seed.bt", binary))},
          {"ot", with_choice(full_file, file_bytes("seed.ot", full))},
          {"binary", with_choice(binary_tree, tree_bytes(binary))},
          {"full", with_choice(full_tree, tree_bytes(full))}};
}

}  // namespace
}  // namespace octomap_inputs

const Target octomap_target{"octomap", octomap_inputs::run, octomap_inputs::seeds};

}  // namespace stillmap::fuzz
