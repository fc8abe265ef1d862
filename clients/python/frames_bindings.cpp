#include <pybind11/stl.h>

#include <exception>
#include <string_view>

#include "clients/library/client.hpp"
#include "clients/python/arrays.hpp"
#include "clients/python/bindings.hpp"
#include "config/loaders/config_error.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/lidar/semantic_class.hpp"
#include "core/map/query/region.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/segmentation/model_error.hpp"
#include "idl/dds/dds_error.hpp"

namespace stillmap::python {
namespace {

/// As py::register_exception, but with texts of any bytes, as names of files have them: in Python
/// they look as os.fsdecode() writes them.
template <typename Fault>
const py::object& register_error(py::module_& module, const char* name, const py::object& base) {
  // As long as the interpreter: the translator uses it, and has no other way to it.
  static const auto& kind = *new py::object(py::exception<Fault>(module, name, base));
  py::register_exception_translator([](std::exception_ptr fault) {
    try {
      if (fault) std::rethrow_exception(fault);
    } catch (const Fault& error) {
      const std::string_view text = error.what();
      const auto decoded = py::reinterpret_steal<py::object>(PyUnicode_DecodeUTF8(
          text.data(), static_cast<py::ssize_t>(text.size()), "surrogateescape"));
      if (decoded) PyErr_SetObject(kind.ptr(), decoded.ptr());
    }
  });
  return kind;
}

/// They have the text that the command line prints.
void bind_errors(py::module_& module) {
  // The one that was registered last is tried first: the general ones before the special ones.
  const auto error = py::exception<std::runtime_error>(module, "Error", PyExc_RuntimeError);
  module.attr("Error").attr("__doc__") = "What goes wrong outside of the caller's code.";
  register_error<DatasetError>(module, "DatasetError", error);
  register_error<MapFileError>(module, "MapFileError", error);
  register_error<ConfigError>(module, "ConfigError", error);
  register_error<ModelError>(module, "ModelError", error);
  register_error<dds::DdsError>(module, "DdsError", error);
  const auto& service = register_error<ServiceError>(module, "ServiceError", error);
  register_error<ServiceTimeout>(module, "ServiceTimeout", service);
}

void bind_classes(py::module_& module) {
  py::tuple names(semantic_class_count);
  py::array_t<std::uint8_t> colours({semantic_class_count, std::size_t{3}});
  for (std::size_t i = 0; i < semantic_class_count; ++i) {
    const auto label = static_cast<SemanticClass>(i);
    names[i] = std::string(name(label));
    const Rgb rgb = colour(label);
    colours.mutable_at(i, 0) = rgb.r;
    colours.mutable_at(i, 1) = rgb.g;
    colours.mutable_at(i, 2) = rgb.b;
  }
  module.attr("CLASS_NAMES") = names;
  module.attr("CLASS_COLOURS") = colours;
}

void bind_trajectory(py::module_& module) {
  py::class_<PythonTrajectory>(module, "Trajectory",
                               "Poses in the order of time, one run after the other.")
      .def(py::init([](const py::object& stamp_ns, const InArray<double>& T_map_body) {
             return trajectory_of(trajectory_from(stamp_ns, T_map_body, "T_map_body"));
           }),
           py::arg("stamp_ns"), py::arg("T_map_body"))
      .def_readonly("stamp_ns", &PythonTrajectory::stamp_ns,
                    "(n,) int64: nanoseconds since the Unix epoch.")
      .def_readonly("T_map_body", &PythonTrajectory::T_map_body,
                    "(n, 4, 4) float64: takes points of the body (the lidar, or the robot where "
                    "frames.base is set) to the map frame [m].")
      .def_property_readonly(
          "positions_map",
          [](const PythonTrajectory& trajectory) {
            const auto rows = py::make_tuple(py::ellipsis(), py::slice(0, 3, 1), 3);
            return py::object(trajectory.T_map_body.attr("__getitem__")(rows));
          },
          "(n, 3) float64: where the body was, map frame [m]; a view of T_map_body.")
      .def("__len__", [](const PythonTrajectory& t) { return t.stamp_ns.size(); });
}

void bind_regions(py::module_& module) {
  py::class_<BoxRegion>(module, "Box", "Axis-aligned, map frame [m]; faces may be infinite.")
      .def(py::init([](const std::array<double, 3>& min_map, const std::array<double, 3>& max_map) {
             return BoxRegion{{Eigen::Vector3d(min_map.data()), Eigen::Vector3d(max_map.data())}};
           }),
           py::arg("min_map"), py::arg("max_map"))
      .def(py::init<>(), "The whole map.");
  py::class_<SphereRegion>(module, "Sphere", "All round a place, map frame [m].")
      .def(py::init([](const std::array<double, 3>& centre_map, double radius_m) {
             return SphereRegion{Eigen::Vector3d(centre_map.data()), radius_m};
           }),
           py::arg("centre_map"), py::arg("radius_m"));
  constexpr double infinity = std::numeric_limits<double>::infinity();
  py::class_<PolygonRegion>(module, "Polygon", "Prism over a simple polygon, map frame [m].")
      .def(py::init([](const InArray<double>& corners_map, double min_z_m, double max_z_m) {
             return PolygonRegion{positions_from(corners_map, "corners_map"), {min_z_m, max_z_m}};
           }),
           py::arg("corners_map"), py::arg("min_z_m") = -infinity, py::arg("max_z_m") = infinity,
           "corners_map: (n, 2), round the outline in either direction.");
  py::class_<CorridorRegion>(module, "Corridor",
                             "Everything not farther than half_width_m from a path, in plan.")
      .def(py::init([](const InArray<double>& path_map, double half_width_m, double min_z_m,
                       double max_z_m) {
             return CorridorRegion{
                 positions_from(path_map, "path_map"), half_width_m, {min_z_m, max_z_m}};
           }),
           py::arg("path_map"), py::arg("half_width_m"), py::arg("min_z_m") = -infinity,
           py::arg("max_z_m") = infinity, "path_map: (n, 2), map frame [m].");
}

}  // namespace

void bind_frames(py::module_& module) {
  bind_errors(module);
  bind_classes(module);
  bind_trajectory(module);
  bind_regions(module);
}

}  // namespace stillmap::python
