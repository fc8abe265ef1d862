#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/lidar/semantic_class.hpp"
#include "core/lidar/trajectory.hpp"

namespace stillmap::python {

namespace py = pybind11;

/// What Python gives: converted where its type or layout is another one.
template <typename T>
using InArray = py::array_t<T, py::array::c_style | py::array::forcecast>;

/// An array on the memory of a list, without a copy: (n), or (n, columns) where an element is made
/// of so many scalars.
template <typename Scalar, typename Element>
py::array_t<Scalar> array_of(std::vector<Element> values, py::ssize_t columns = 0) {
  static_assert(sizeof(Element) % sizeof(Scalar) == 0);
  auto held = std::make_unique<std::vector<Element>>(std::move(values));
  auto* const list = held.get();
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(list->size())};
  if (columns > 0) shape.push_back(columns);
  const py::capsule owner(held.release(),
                          [](void* freed) { delete static_cast<std::vector<Element>*>(freed); });
  return py::array_t<Scalar>(shape, reinterpret_cast<const Scalar*>(list->data()), owner);
}

/// "points_lidar has the shape (3, 5); (n, 3) is wanted".
[[noreturn]] void refuse_shape(const std::string& name, const py::array& array,
                               const std::string& wanted);

/// (n, 3) of numbers [m].
[[nodiscard]] std::vector<Eigen::Vector3f> points_from(const InArray<float>& array,
                                                       const std::string& name);
/// (n, 2) of numbers [m].
[[nodiscard]] std::vector<Eigen::Vector2d> positions_from(const InArray<double>& array,
                                                          const std::string& name);
/// (size), of one value for each point.
template <typename T>
std::vector<T> values_from(const std::optional<InArray<T>>& array, const std::string& name,
                           std::size_t size) {
  if (!array) return {};
  if (array->ndim() != 1 || static_cast<std::size_t>(array->size()) != size) {
    refuse_shape(name, *array, "(" + std::to_string(size) + ",), one for each point,");
  }
  return {array->data(), array->data() + array->size()};
}

/// An array of whole numbers from `least` to `most`. Throws std::invalid_argument for others:
/// NumPy's own conversion cuts fractions off, and wraps what does not fit.
[[nodiscard]] py::array whole_numbers(const py::object& given, const std::string& name,
                                      std::int64_t least, std::int64_t most);
/// The same, of numbers that T holds; nothing where nothing was given.
template <typename T>
std::optional<InArray<T>> integers_from(const std::optional<py::object>& given,
                                        const std::string& name) {
  using Limits = std::numeric_limits<T>;
  static_assert(Limits::is_integer && Limits::digits <= std::numeric_limits<std::int64_t>::digits);
  if (!given) return std::nullopt;
  return InArray<T>(whole_numbers(*given, name, Limits::min(), Limits::max()));
}
/// Throws std::invalid_argument for an index of CLASS_NAMES that there is not.
[[nodiscard]] std::vector<SemanticClass> classes_from(std::span<const std::int64_t> indexes,
                                                      const std::string& name);

/// (4, 4); the last row is 0 0 0 1.
[[nodiscard]] Eigen::Isometry3d transform_from(const InArray<double>& array,
                                               const std::string& name);
/// (n, 4, 4).
[[nodiscard]] std::vector<Eigen::Isometry3d> transforms_from(const InArray<double>& array,
                                                             const std::string& name);

[[nodiscard]] py::array_t<double> array_from(const Eigen::Isometry3d& T);
[[nodiscard]] py::array_t<double> array_from(std::span<const StampedPose> poses);
[[nodiscard]] py::array_t<double> array_from(const Eigen::MatrixXd& matrix);

/// The same array, which Python must not write to.
[[nodiscard]] py::object read_only(py::array array);

/// An object with these fields (types.SimpleNamespace).
[[nodiscard]] py::object namespace_of(const py::dict& fields);

/// Arrays of what Python calls a trajectory.
struct PythonTrajectory {
  py::array_t<std::int64_t> stamp_ns;
  py::array_t<double> T_map_body;
};
[[nodiscard]] PythonTrajectory trajectory_of(const Trajectory& trajectory);
/// Throws std::invalid_argument where the lengths differ.
[[nodiscard]] Trajectory trajectory_from(const py::object& stamp_ns,
                                         const InArray<double>& T_map_body,
                                         const std::string& name);

}  // namespace stillmap::python
