#include <pybind11/stl.h>

#include "clients/python/arrays.hpp"
#include "clients/python/bindings.hpp"
#include "core/evaluation/confusion_matrix.hpp"
#include "core/evaluation/map_cleaning.hpp"
#include "core/evaluation/trajectory_error.hpp"

namespace stillmap::python {
namespace {

using evaluation::Alignment;
using evaluation::ConfusionMatrix;

Alignment alignment_named(const std::string& name) {
  if (name == "none") return Alignment::none;
  if (name == "first_pose") return Alignment::first_pose;
  if (name == "rigid") return Alignment::rigid;
  throw std::invalid_argument("alignment '" + name +
                              "' is not known; there are none, first_pose and rigid");
}

evaluation::PosePairs pairs_from(const InArray<double>& truth, const InArray<double>& estimate) {
  return evaluation::pair_by_index(transforms_from(truth, "truth"),
                                   transforms_from(estimate, "estimate"));
}

py::dict absolute_error(const InArray<double>& truth, const InArray<double>& estimate,
                        const std::string& alignment) {
  auto error = evaluation::absolute_trajectory_error(pairs_from(truth, estimate),
                                                     alignment_named(alignment));
  py::dict fields;
  fields["rmse_m"] = error.rmse_m;
  fields["mean_m"] = error.mean_m;
  fields["max_m"] = error.max_m;
  fields["final_m"] = error.final_m;
  fields["per_pose_m"] = array_of<double>(std::move(error.per_pose_m));
  fields["T_truth_estimate"] = array_from(error.T_truth_estimate);
  return fields;
}

py::object relative_error(const InArray<double>& truth, const InArray<double>& estimate) {
  const auto error = evaluation::relative_pose_error(pairs_from(truth, estimate));
  if (!error) return py::none();
  py::dict fields;
  fields["mean_translation_m"] = error->mean_translation_m;
  fields["rmse_translation_m"] = error->rmse_translation_m;
  fields["max_translation_m"] = error->max_translation_m;
  fields["mean_rotation_rad"] = error->mean_rotation_rad;
  fields["max_rotation_rad"] = error->max_rotation_rad;
  return fields;
}

py::object kitti_error(const InArray<double>& truth, const InArray<double>& estimate) {
  const auto error = evaluation::kitti_odometry_error(pairs_from(truth, estimate));
  if (!error) return py::none();
  py::dict fields;
  fields["translation_percent"] = error->translation_percent;
  fields["rotation_deg_per_100m"] = error->rotation_deg_per_100m;
  fields["segments"] = error->segments;
  return fields;
}

std::vector<SemanticClass> classes_in(const py::object& labels, const std::string& name) {
  const auto indexes = integers_from<std::int64_t>(labels, name);
  const auto size = static_cast<std::size_t>(indexes->size());
  return classes_from(values_from(indexes, name, size), name);
}

/// SemanticKITTI has the instance in the upper half of a label.
std::vector<std::uint16_t> ids_in(const py::object& labels, const std::string& name,
                                  std::size_t size) {
  const auto values = values_from(integers_from<std::uint32_t>(labels, name), name, size);
  std::vector<std::uint16_t> ids;
  ids.reserve(values.size());
  for (const std::uint32_t label : values)
    ids.push_back(static_cast<std::uint16_t>(label & 0xFFFF));
  return ids;
}

py::array_t<std::uint64_t> counts_of(const ConfusionMatrix& matrix) {
  py::array_t<std::uint64_t> counts({semantic_class_count, semantic_class_count});
  for (std::size_t t = 0; t < semantic_class_count; ++t) {
    for (std::size_t p = 0; p < semantic_class_count; ++p) {
      counts.mutable_at(t, p) =
          matrix.count(static_cast<SemanticClass>(t), static_cast<SemanticClass>(p));
    }
  }
  return counts;
}

py::dict cleaning_score(const InArray<float>& truth_points_map, const py::object& truth_ids,
                        const InArray<float>& points_map, double voxel_size_m) {
  const auto truth_points = points_from(truth_points_map, "truth_points_map");
  const auto ids = ids_in(truth_ids, "truth_ids", truth_points.size());
  const auto points = points_from(points_map, "points_map");
  evaluation::MapCleaningScore score;
  {
    const py::gil_scoped_release released;
    evaluation::MapTruth truth(voxel_size_m);
    truth.add(truth_points, ids);
    score = evaluation::map_cleaning_score(truth, points);
  }
  py::dict fields;
  fields["preservation_rate"] = score.preservation_rate();
  fields["rejection_rate"] = score.rejection_rate();
  fields["parked_rejection_rate"] = score.parked_rejection_rate();
  fields["f1"] = score.f1();
  fields["fixed_voxels"] = score.fixed_voxels;
  fields["parked_voxels"] = score.parked_voxels;
  fields["moving_voxels"] = score.moving_voxels;
  return fields;
}

}  // namespace

void bind_evaluation(py::module_& module) {
  module.def("absolute_trajectory_error", &absolute_error, py::arg("truth"), py::arg("estimate"),
             py::arg("alignment") = "rigid",
             "ATE in translation. truth, estimate: (n, 4, 4) of the same body at the same times. "
             "alignment: rigid (Umeyama, scale 1), first_pose, none. A dict of rmse_m, mean_m, "
             "max_m, final_m, per_pose_m (n,), T_truth_estimate (4, 4).");
  module.def("relative_pose_error", &relative_error, py::arg("truth"), py::arg("estimate"),
             "Error of the motion from pose to pose; None for fewer than two.");
  module.def("kitti_odometry_error", &kitti_error, py::arg("truth"), py::arg("estimate"),
             "The figures of the KITTI odometry benchmark; None for less than 100 m.");
  module.def("map_cleaning_score", &cleaning_score, py::arg("truth_points_map"),
             py::arg("truth_ids"), py::arg("points_map"), py::arg("voxel_size_m") = 0.2,
             "Preservation and rejection rate (ERASOR, RA-L 2021). truth_points_map: (n, 3) of all "
             "labelled scans [m]; truth_ids: (n,) original SemanticKITTI ids; points_map: (m, 3) "
             "of the map. Rates are None where there is nothing to count.");
  py::class_<ConfusionMatrix>(module, "ConfusionMatrix",
                              "Counts of (true class, predicted class), as semantic-kitti-api.")
      .def(py::init<>())
      .def(
          "add",
          [](ConfusionMatrix& matrix, const py::object& truth, const py::object& predicted) {
            matrix.add(classes_in(truth, "truth"), classes_in(predicted, "predicted"));
          },
          py::arg("truth"), py::arg("predicted"),
          "Counts a scan: (n,) and (n,) indexes of CLASS_NAMES.")
      .def_property_readonly("counts", &counts_of, "(20, 20) uint64: [true, predicted].")
      .def(
          "iou",
          [](const ConfusionMatrix& matrix, const std::string& label) {
            const auto known = class_from_name(label);
            if (!known) throw std::invalid_argument("there is no class '" + label + "'");
            return matrix.iou(*known);
          },
          py::arg("label"), "Of a class by name; None where it does not occur.")
      .def_property_readonly("mean_iou", &ConfusionMatrix::mean_iou,
                             "Over all 19 classes; absent ones count 0.")
      .def_property_readonly("mean_iou_of_present", &ConfusionMatrix::mean_iou_of_present)
      .def_property_readonly("accuracy", &ConfusionMatrix::accuracy);
}

}  // namespace stillmap::python
