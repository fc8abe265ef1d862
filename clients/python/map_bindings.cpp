#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <tbb/parallel_for.h>

#include <filesystem>

#include "clients/python/bindings.hpp"
#include "clients/python/map.hpp"
#include "clients/python/traversability.hpp"
#include "core/map/query/map_query.hpp"
#include "core/map/storage/shown_map.hpp"

namespace stillmap::python {
namespace {

struct TileOfMap {
  std::shared_ptr<const Tile> tile;
};

/// What there is of every voxel, in the order of tiles and voxels.
struct Voxels {
  explicit Voxels(std::size_t size)
      : position_map({static_cast<py::ssize_t>(size), py::ssize_t{3}}),
        label(static_cast<py::ssize_t>(size)),
        confidence(static_cast<py::ssize_t>(size)),
        point_count(static_cast<py::ssize_t>(size)),
        first_seen_ns(static_cast<py::ssize_t>(size)),
        last_seen_ns(static_cast<py::ssize_t>(size)) {}

  py::array_t<float> position_map;
  py::array_t<std::uint8_t> label;
  py::array_t<float> confidence;
  py::array_t<std::uint16_t> point_count;
  py::array_t<std::int64_t> first_seen_ns;
  py::array_t<std::int64_t> last_seen_ns;
};

/// Where the arrays lie, for threads without the interpreter.
struct VoxelMemory {
  explicit VoxelMemory(Voxels& voxels)
      : position_map(voxels.position_map.mutable_data()),
        label(voxels.label.mutable_data()),
        confidence(voxels.confidence.mutable_data()),
        point_count(voxels.point_count.mutable_data()),
        first_seen_ns(voxels.first_seen_ns.mutable_data()),
        last_seen_ns(voxels.last_seen_ns.mutable_data()) {}

  void write(const PackedVoxels& from, TileId tile, std::size_t begin) const {
    const VoxelGrid grid = from.grid();
    const auto packed = from.packed();
    const auto stamps_ns = from.stamps_ns();
    for (std::size_t k = 0; k < packed.size(); ++k) {
      const std::size_t i = begin + k;
      Eigen::Map<Eigen::Vector3f>(position_map + 3 * i) = mean_map(packed[k], tile, grid);
      label[i] = static_cast<std::uint8_t>(packed[k].evidence.winner());
      confidence[i] = packed[k].evidence.share();
      point_count[i] = packed[k].point_count;
      first_seen_ns[i] = stamps_ns[from.first_stamp(k)];
      last_seen_ns[i] = stamps_ns[from.last_stamp(k)];
    }
  }

  float* position_map;
  std::uint8_t* label;
  float* confidence;
  std::uint16_t* point_count;
  std::int64_t* first_seen_ns;
  std::int64_t* last_seen_ns;
};

using Tiles = std::vector<std::shared_ptr<const Tile>>;

Tiles tiles_of(const MapSnapshot& view) { return {view.tiles.begin(), view.tiles.end()}; }

/// Where each tile's voxels begin, and the number of all.
std::vector<std::size_t> offsets_of(const Tiles& tiles) {
  std::vector<std::size_t> offsets{0};
  for (const auto& tile : tiles) offsets.push_back(offsets.back() + tile->voxels.size());
  return offsets;
}

Voxels voxels_of(const Tiles& tiles) {
  const std::vector<std::size_t> offsets = offsets_of(tiles);
  Voxels voxels(offsets.back());
  const VoxelMemory memory(voxels);
  const py::gil_scoped_release released;
  tbb::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
    memory.write(tiles[i]->voxels, tiles[i]->info.id, offsets[i]);
  });
  return voxels;
}

/// Labels (n, 3) and weights (n, 3) of the votes for each voxel's classes.
py::tuple votes_of(const Tiles& tiles) {
  constexpr auto candidates = static_cast<py::ssize_t>(ClassEvidence::candidates);
  const std::vector<std::size_t> offsets = offsets_of(tiles);
  const auto size = static_cast<py::ssize_t>(offsets.back());
  py::array_t<std::uint8_t> labels({size, candidates});
  py::array_t<float> weights({size, candidates});
  std::uint8_t* label = labels.mutable_data();
  float* weight = weights.mutable_data();
  for (const auto& tile : tiles) {
    for (const PackedVoxel& voxel : tile->voxels.packed()) {
      for (const ClassEvidence::Vote& vote : voxel.evidence.votes()) {
        *label++ = static_cast<std::uint8_t>(vote.label);
        *weight++ = vote.weight;
      }
    }
  }
  return py::make_tuple(labels, weights);
}

py::dtype packed_dtype() {
  py::dict fields;
  fields["names"] =
      std::vector<std::string>{"key", "offset_sum", "point_count", "weights", "classes"};
  fields["formats"] = std::vector<std::string>{"<u4", "(3,)<u2", "<u2", "(3,)<u2", "<u2"};
  fields["offsets"] = std::vector<int>{0, 4, 10, 12, 18};
  fields["itemsize"] = sizeof(PackedVoxel);
  return py::dtype::from_args(fields);
}

void bind_tile(py::module_& module) {
  py::class_<TileOfMap>(module, "Tile", "A square column of the map, all heights.")
      .def_property_readonly(
          "id", [](const TileOfMap& t) { return std::pair(t.tile->info.id.x, t.tile->info.id.y); },
          "(x, y): [x, x+1) * tile_size_m by [y, y+1) * tile_size_m of the map frame.")
      .def_property_readonly(
          "revision", [](const TileOfMap& t) { return t.tile->info.revision; },
          "Version of the map in which it last changed.")
      .def_property_readonly("content_hash",
                             [](const TileOfMap& t) { return t.tile->info.content_hash; })
      .def("__len__", [](const TileOfMap& t) { return t.tile->voxels.size(); })
      .def(
          "voxels", [](const TileOfMap& t) { return voxels_of({t.tile}); }, "Its voxels as arrays.")
      .def_property_readonly(
          "packed",
          [](const py::object& self) {
            const auto packed = self.cast<const TileOfMap&>().tile->voxels.packed();
            return read_only(py::array(packed_dtype(), {static_cast<py::ssize_t>(packed.size())},
                                       {static_cast<py::ssize_t>(sizeof(PackedVoxel))},
                                       packed.data(), self));
          },
          "The voxels as they lie in memory, without a copy: a structured array, 20 bytes each.");
}

void bind_voxels(py::module_& module) {
  py::class_<Voxels>(module, "Voxels", "Voxels of the static map, as arrays of one length.")
      .def_readonly("position_map", &Voxels::position_map,
                    "(n, 3) float32: mean of the points in it, map frame [m].")
      .def_readonly("label", &Voxels::label, "(n,) uint8: index of CLASS_NAMES.")
      .def_readonly("confidence", &Voxels::confidence,
                    "(n,) float32: the label's share of the evidence, 0..1.")
      .def_readonly("point_count", &Voxels::point_count, "(n,) uint16: 65535 is that many or more.")
      .def_readonly("first_seen_ns", &Voxels::first_seen_ns, "(n,) int64.")
      .def_readonly("last_seen_ns", &Voxels::last_seen_ns, "(n,) int64.")
      .def("__len__", [](const Voxels& voxels) { return voxels.label.size(); });
}

/// Columns of a list of structures, without a copy.
template <typename Scalar, typename Element>
py::object column_of(const std::vector<Element>& values, const void* first, const py::object& owner,
                     py::ssize_t columns = 0) {
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(values.size())};
  std::vector<py::ssize_t> strides{static_cast<py::ssize_t>(sizeof(Element))};
  if (columns > 0) {
    shape.push_back(columns);
    strides.push_back(sizeof(Scalar));
  }
  return read_only(py::array_t<Scalar>(shape, strides, static_cast<const Scalar*>(first), owner));
}

void bind_answers(py::module_& module) {
  const auto column = [](auto scalar, auto member, py::ssize_t columns) {
    return [member, columns](const py::object& self) {
      const auto& voxels = self.cast<const MapQueryResult&>().voxels;
      const void* first = voxels.empty() ? nullptr : &(voxels.front().*member);
      return column_of<decltype(scalar)>(voxels, first, self, columns);
    };
  };
  py::class_<MapQueryResult>(module, "QueryAnswer",
                             "Voxels of a region; the arrays share the answer's memory.")
      .def_property_readonly("position_map", column(float{}, &QueryVoxel::position_map, 3),
                             "(n, 3) float32: map frame [m].")
      .def_property_readonly("label", column(std::uint8_t{}, &QueryVoxel::label, 0),
                             "(n,) uint8: index of CLASS_NAMES.")
      .def_property_readonly("confidence", column(float{}, &QueryVoxel::confidence, 0),
                             "(n,) float32, 0..1.")
      .def_property_readonly("point_count", column(std::uint32_t{}, &QueryVoxel::point_count, 0),
                             "(n,) uint32.")
      .def_readonly("map_version", &MapQueryResult::map_version)
      .def_readonly("map_id", &MapQueryResult::map_id)
      .def("__len__", [](const MapQueryResult& answer) { return answer.voxels.size(); });
}

py::object query(const Map& map, const Region& region, const std::vector<std::string>& classes,
                 double resolution_m) {
  MapQuery query;
  query.region = region;
  query.classes = classes_from(classes);
  query.resolution_m = resolution_m;
  query.max_bytes = std::numeric_limits<std::uint32_t>::max();
  MapQueryResult all;
  {
    const py::gil_scoped_release released;
    for (bool first = true; first || !query.continuation.empty(); first = false) {
      MapQueryResult page = query_map(*map.view, query);
      query.continuation = page.continuation;
      if (first) {
        all = std::move(page);
        continue;
      }
      all.status = page.status;
      all.reason = page.reason;
      all.voxels.insert(all.voxels.end(), page.voxels.begin(), page.voxels.end());
    }
  }
  return query_answer(std::move(all));
}

py::object removed_of(const Map& map) {
  std::vector<RemovedVoxel> removed;
  if (map.read_evidence) {
    const py::gil_scoped_release released;
    for (const auto& [id, evidence] : map.read_evidence()) {
      if (!evidence) continue;
      const auto of_tile = removed_voxels(*evidence, map.view->voxel_size_m, map.view->tile_size_m);
      removed.insert(removed.end(), of_tile.begin(), of_tile.end());
    }
  }
  return removed_arrays(removed);
}

Map open_map(const std::filesystem::path& file) {
  auto [saved, read_evidence] = read_shown_map(file);
  return {.view = std::make_shared<const MapSnapshot>(std::move(saved.view)),
          .trajectory = saved.trajectory.to_vector(),
          .metadata = std::move(saved.metadata),
          .read_evidence = std::move(read_evidence)};
}

void bind_description(py::class_<Map>& bound) {
  bound.def_property_readonly("version", [](const Map& map) { return map.view->version; })
      .def_property_readonly("map_id", [](const Map& map) { return map.view->map_id; })
      .def_property_readonly("voxel_size_m", [](const Map& map) { return map.view->voxel_size_m; })
      .def_property_readonly("tile_size_m", [](const Map& map) { return map.view->tile_size_m; })
      .def_property_readonly(
          "trajectory", [](const Map& map) { return trajectory_of(map.trajectory); },
          "The path; empty where it is not known.")
      .def_readonly("metadata", &Map::metadata, "Free text by key, as \"sensor\".")
      .def_property_readonly(
          "tiles",
          [](const Map& map) {
            std::vector<TileOfMap> tiles;
            for (const auto& tile : map.view->tiles) tiles.push_back({tile});
            return tiles;
          },
          "List of Tile, sorted by id.")
      .def("__len__", [](const Map& map) { return map.view->tiles.voxel_count(); });
}

/// What a map is asked for.
void bind_questions(py::class_<Map>& bound) {
  bound
      .def(
          "voxels", [](const Map& map) { return voxels_of(tiles_of(*map.view)); },
          "All voxels as arrays, in the order of the tiles.")
      .def(
          "evidence", [](const Map& map) { return votes_of(tiles_of(*map.view)); },
          "(labels (n, 3) uint8, weights (n, 3) float32): votes for the strongest classes of every "
          "voxel, in the order of voxels(); a weight of 0 is no vote. Maps of a server have the "
          "winner alone.")
      .def("removed", &removed_of,
           "What is kept out of the map, and why: position_map (n, 3) float32 [m], label (n,), "
           "reason (n,) text, last_seen_ns (n,). Empty for a map of a server; ask the client. Of a "
           "map file, it is read when it is asked for: raises MapFileError if the file was changed "
           "since.")
      .def("query", &query, py::arg("region"), py::arg("classes") = std::vector<std::string>{},
           py::arg("resolution_m") = 0.0,
           "Voxels of a region. classes: names, none are all. resolution_m: 0 is the map's own. "
           "Raises ValueError for a region that cannot be used.")
      .def(
          "traversability",
          [](const Map& map, const std::string& robot) {
            const py::gil_scoped_release released;
            return traversability_of(*map.view, robot);
          },
          py::arg("robot") = "car",
          "Where a robot (car, delivery_robot, tracked, or a file) can go. Raises ConfigError.");
}

}  // namespace

std::bitset<semantic_class_count> classes_from(const std::vector<std::string>& names) {
  std::bitset<semantic_class_count> classes;
  for (const std::string& wanted : names) {
    const auto label = class_from_name(wanted);
    if (!label) throw std::invalid_argument("there is no class '" + wanted + "'; see CLASS_NAMES");
    classes.set(static_cast<std::size_t>(*label));
  }
  return classes;
}

py::object query_answer(MapQueryResult result) {
  if (result.status != QueryStatus::ok) throw std::invalid_argument(result.reason);
  return py::cast(std::make_unique<MapQueryResult>(std::move(result)));
}

py::object removed_arrays(const std::vector<RemovedVoxel>& removed) {
  std::vector<Eigen::Vector3f> positions;
  std::vector<std::uint8_t> labels;
  std::vector<std::int64_t> last_seen_ns;
  py::list reasons;
  for (const RemovedVoxel& voxel : removed) {
    positions.push_back(voxel.position_map);
    labels.push_back(static_cast<std::uint8_t>(voxel.label));
    last_seen_ns.push_back(voxel.last_seen_ns);
    reasons.append(std::string(name(voxel.reason)));
  }
  const py::object types = py::module_::import("types");
  return types.attr("SimpleNamespace")(
      py::arg("position_map") = array_of<float>(std::move(positions), 3),
      py::arg("label") = array_of<std::uint8_t>(std::move(labels)),
      py::arg("last_seen_ns") = array_of<std::int64_t>(std::move(last_seen_ns)),
      py::arg("reason") = py::module_::import("numpy").attr("array")(reasons, "U"));
}

void bind_map(py::module_& module) {
  bind_voxels(module);
  bind_tile(module);
  bind_answers(module);
  py::class_<Map> map(module, "Map", "A state of the static map, which does not change.");
  bind_description(map);
  bind_questions(map);
  module.def(
      "open_map",
      [](const std::filesystem::path& file) {
        const py::gil_scoped_release released;
        return open_map(file);
      },
      py::arg("file"),
      "Opens a map file; it stays as it is, and a server may have it open: then this is its last "
      "save. Raises MapFileError.");
}

}  // namespace stillmap::python
