#include "clients/python/arrays.hpp"

#include <cstring>

namespace stillmap::python {
namespace {

using RowMajor4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

std::string shape_of(const py::array& array) {
  std::string text = "(";
  for (py::ssize_t i = 0; i < array.ndim(); ++i) {
    text += (i > 0 ? ", " : "") + std::to_string(array.shape(i));
  }
  return text + ")";
}

Eigen::Isometry3d transform_at(const double* values, const std::string& name) {
  const Eigen::Map<const RowMajor4> matrix(values);
  if (!matrix.allFinite()) throw std::invalid_argument(name + " is not finite");
  if (!matrix.row(3).isApprox(Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0), 1e-9)) {
    throw std::invalid_argument(name + " is no transform: its last row is not 0 0 0 1");
  }
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  if (!(rotation * rotation.transpose()).isIdentity(1e-3) || rotation.determinant() < 0.0) {
    throw std::invalid_argument(name + " is no rotation and translation");
  }
  Eigen::Isometry3d T;
  T.matrix() = matrix;
  return T;
}

void copy_to(const Eigen::Isometry3d& T, double* values) {
  Eigen::Map<RowMajor4>{values} = T.matrix();
}

}  // namespace

void refuse_shape(const std::string& name, const py::array& array, const std::string& wanted) {
  throw std::invalid_argument(name + " has the shape " + shape_of(array) + "; " + wanted +
                              " is wanted");
}

std::vector<Eigen::Vector3f> points_from(const InArray<float>& array, const std::string& name) {
  if (array.ndim() != 2 || array.shape(1) != 3) refuse_shape(name, array, "(n, 3)");
  std::vector<Eigen::Vector3f> points(static_cast<std::size_t>(array.shape(0)));
  if (!points.empty()) {
    std::memcpy(points.data()->data(), array.data(), points.size() * sizeof(Eigen::Vector3f));
  }
  return points;
}

std::vector<Eigen::Vector2d> positions_from(const InArray<double>& array, const std::string& name) {
  if (array.ndim() != 2 || array.shape(1) != 2) refuse_shape(name, array, "(n, 2)");
  std::vector<Eigen::Vector2d> positions;
  for (py::ssize_t i = 0; i < array.shape(0); ++i) {
    positions.emplace_back(array.at(i, 0), array.at(i, 1));
  }
  return positions;
}

py::array whole_numbers(const py::object& given, const std::string& name, std::int64_t least,
                        std::int64_t most) {
  const auto array = py::array::ensure(given);
  if (!array) throw std::invalid_argument(name + " is no array of numbers");
  // An empty list becomes an array of float64.
  if (array.size() == 0) return array;
  const std::string wanted = "; whole numbers from " + std::to_string(least) + " to " +
                             std::to_string(most) + " are wanted";
  const char kind = array.dtype().kind();
  if (kind != 'i' && kind != 'u' && kind != 'b') {
    throw std::invalid_argument(name + " has the type " +
                                std::string(py::str(py::object(array.dtype()))) + wanted);
  }
  const py::int_ smallest(array.attr("min")());
  const py::int_ largest(array.attr("max")());
  if (smallest < py::int_(least) || largest > py::int_(most)) {
    const py::int_& outside = largest > py::int_(most) ? largest : smallest;
    throw std::invalid_argument(name + " has the number " +
                                std::string(py::str(py::object(outside))) + wanted);
  }
  return array;
}

std::vector<SemanticClass> classes_from(std::span<const std::int64_t> indexes,
                                        const std::string& name) {
  std::vector<SemanticClass> classes;
  classes.reserve(indexes.size());
  for (const std::int64_t index : indexes) {
    if (index < 0 || index >= static_cast<std::int64_t>(semantic_class_count)) {
      throw std::invalid_argument(name + " has the class " + std::to_string(index) +
                                  "; there are 0 to " + std::to_string(semantic_class_count - 1));
    }
    classes.push_back(static_cast<SemanticClass>(index));
  }
  return classes;
}

Eigen::Isometry3d transform_from(const InArray<double>& array, const std::string& name) {
  if (array.ndim() != 2 || array.shape(0) != 4 || array.shape(1) != 4) {
    refuse_shape(name, array, "(4, 4)");
  }
  return transform_at(array.data(), name);
}

std::vector<Eigen::Isometry3d> transforms_from(const InArray<double>& array,
                                               const std::string& name) {
  if (array.ndim() != 3 || array.shape(1) != 4 || array.shape(2) != 4) {
    refuse_shape(name, array, "(n, 4, 4)");
  }
  std::vector<Eigen::Isometry3d> transforms;
  for (py::ssize_t i = 0; i < array.shape(0); ++i) {
    transforms.push_back(transform_at(array.data(i), name + "[" + std::to_string(i) + "]"));
  }
  return transforms;
}

py::array_t<double> array_from(const Eigen::Isometry3d& T) {
  py::array_t<double> array({4, 4});
  copy_to(T, array.mutable_data());
  return array;
}

py::array_t<double> array_from(std::span<const StampedPose> poses) {
  py::array_t<double> array(
      {static_cast<py::ssize_t>(poses.size()), py::ssize_t{4}, py::ssize_t{4}});
  double* values = array.mutable_data();
  for (const StampedPose& pose : poses) {
    copy_to(pose.T_map_lidar, values);
    values += 16;
  }
  return array;
}

py::array_t<double> array_from(const Eigen::MatrixXd& matrix) {
  py::array_t<double> array({matrix.rows(), matrix.cols()});
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) {
      array.mutable_at(row, column) = matrix(row, column);
    }
  }
  return array;
}

py::object read_only(py::array array) {
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

py::object namespace_of(const py::dict& fields) {
  return py::module_::import("types").attr("SimpleNamespace")(**fields);
}

PythonTrajectory trajectory_of(const Trajectory& trajectory) {
  std::vector<std::int64_t> stamps_ns;
  for (const StampedPose& pose : trajectory) stamps_ns.push_back(pose.stamp_ns);
  return {array_of<std::int64_t>(std::move(stamps_ns)), array_from(trajectory)};
}

Trajectory trajectory_from(const py::object& stamp_ns, const InArray<double>& T_map_body,
                           const std::string& name) {
  const auto transforms = transforms_from(T_map_body, name);
  const std::string stamp_name = name + "'s stamp_ns";
  const auto stamps =
      values_from(integers_from<std::int64_t>(stamp_ns, stamp_name), stamp_name, transforms.size());
  Trajectory trajectory;
  for (std::size_t i = 0; i < stamps.size(); ++i) trajectory.push_back({stamps[i], transforms[i]});
  return trajectory;
}

}  // namespace stillmap::python
