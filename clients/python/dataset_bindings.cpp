#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <mutex>
#include <utility>

#include "clients/python/arrays.hpp"
#include "clients/python/bindings.hpp"
#include "clients/python/scan.hpp"
#include "config/loaders/sensor_file.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/lidar/turn_joiner.hpp"
#include "idl/bag/bag_scan_source.hpp"

namespace stillmap::python {
namespace {

/// On the scan's own memory, which the array keeps alive.
template <typename Scalar, typename Element>
py::object view_of(const std::vector<Element>& values, const py::object& owner,
                   py::ssize_t columns = 0) {
  if (values.empty()) return py::none();
  std::vector<py::ssize_t> shape{static_cast<py::ssize_t>(values.size())};
  if (columns > 0) shape.push_back(columns);
  return py::array_t<Scalar>(shape, reinterpret_cast<const Scalar*>(values.data()), owner);
}

template <typename Scalar, auto member>
py::object scan_values(const py::object& self) {
  return view_of<Scalar>(self.cast<const DatasetFrame&>().scan.*member, self);
}

std::size_t index_from(const ScanDataset& dataset, py::ssize_t index) {
  const auto size = static_cast<py::ssize_t>(dataset.size());
  const py::ssize_t place = index < 0 ? index + size : index;
  if (place < 0 || place >= size) {
    throw py::index_error("scan " + std::to_string(index) + " of " + std::to_string(size));
  }
  return static_cast<std::size_t>(place);
}

void bind_scan(py::module_& module) {
  py::class_<DatasetFrame>(module, "Scan",
                           "One revolution of the lidar. Arrays are None where "
                           "nothing is known; they share the scan's memory.")
      .def(py::init(&frame_from_arrays), py::arg("points_lidar"), py::arg("stamp_ns") = 0,
           py::arg("intensity") = py::none(), py::arg("time_offset_s") = py::none(),
           py::arg("ring") = py::none(), py::arg("labels") = py::none())
      .def_property_readonly("stamp_ns", [](const DatasetFrame& f) { return f.scan.stamp_ns; })
      .def_property_readonly(
          "points_lidar",
          [](const py::object& self) {
            const auto& points = self.cast<const DatasetFrame&>().scan.points_lidar;
            return py::array_t<float>({static_cast<py::ssize_t>(points.size()), py::ssize_t{3}},
                                      reinterpret_cast<const float*>(points.data()), self);
          },
          "(n, 3) float32: lidar frame, x forward, y left, z up [m].")
      .def_property_readonly("intensity", &scan_values<float, &Scan::intensity>,
                             "(n,) float32, 0..1, or None.")
      .def_property_readonly("time_offset_s", &scan_values<float, &Scan::time_offset_s>,
                             "(n,) float32: from stamp_ns on [s], or None.")
      .def_property_readonly("ring", &scan_values<std::uint16_t, &Scan::ring>,
                             "(n,) uint16 in the source's own order, or None.")
      .def_property_readonly(
          "labels",
          [](const py::object& self) -> py::object {
            py::object labels = scan_values<std::uint8_t, &Scan::labels>(self);
            // They were checked.
            return labels.is_none() ? labels : read_only(labels);
          },
          "(n,) uint8: index of CLASS_NAMES, or None. Not to be written to.")
      .def_property_readonly(
          "raw_labels",
          [](const py::object& self) {
            return view_of<std::uint32_t>(self.cast<const DatasetFrame&>().raw_labels, self);
          },
          "(n,) uint32: original SemanticKITTI labels, instances in the high 16 bits, or None.")
      .def("__len__", [](const DatasetFrame& frame) { return frame.scan.size(); });
}

void bind_sensor(py::module_& module) {
  py::class_<SensorModel>(module, "Sensor", "Description of a lidar.")
      .def_readonly("name", &SensorModel::name)
      .def_readonly("rings", &SensorModel::rings)
      .def_readonly("period_s", &SensorModel::period_s, "Of one revolution [s].");
  module.def(
      "load_sensor", [](const std::string& name_or_file) { return load_sensor(name_or_file); },
      py::arg("name_or_file"),
      "hdl_64e, hdl_32e, vlp_16, or a file like those in config/sensors. Raises ConfigError.");
}

}  // namespace

DatasetFrame frame_from_arrays(const InArray<float>& points_lidar, std::int64_t stamp_ns,
                               const std::optional<InArray<float>>& intensity,
                               const std::optional<InArray<float>>& time_offset_s,
                               const std::optional<py::object>& ring,
                               const std::optional<py::object>& labels) {
  DatasetFrame frame;
  Scan& scan = frame.scan;
  scan.stamp_ns = stamp_ns;
  scan.points_lidar = points_from(points_lidar, "points_lidar");
  const std::size_t size = scan.points_lidar.size();
  scan.intensity = values_from(intensity, "intensity", size);
  scan.time_offset_s = values_from(time_offset_s, "time_offset_s", size);
  scan.ring = values_from(integers_from<std::uint16_t>(ring, "ring"), "ring", size);
  scan.labels = classes_from(
      values_from(integers_from<std::int64_t>(labels, "labels"), "labels", size), "labels");
  return frame;
}

namespace {

/// Readers of a bag keep a place in its file: threads of Python come one after the other.
struct SharedRecording {
  explicit SharedRecording(dds::Recording opened) : recording(std::move(opened)) {}
  dds::Recording recording;
  std::mutex reading;
};

/// Throws DatasetError, with the ways out, where nobody says what the labels are and they are no
/// SemanticKITTI ids by their looks.
void require_semantic_kitti_labels(const ScanDataset& dataset, const std::filesystem::path& path) {
  const std::string doubt = dataset.label_census().doubt();
  if (doubt.empty()) return;
  throw DatasetError(path, "its labels would be read as SemanticKITTI ids and " + doubt +
                               ". labels_are_classes=True reads them as classes (0 is unlabeled, 1 "
                               "car, 9 road), labels_are_classes=False as ids all the same, "
                               "which does no harm where the labels are not used");
}

std::vector<ImuSample> imu_of(SharedRecording& shared) {
  const py::gil_scoped_release released;
  const std::scoped_lock lock(shared.reading);
  return shared.recording.dataset.imu();
}

std::vector<std::string> remarks_of(SharedRecording& shared) {
  const py::gil_scoped_release released;
  const std::scoped_lock lock(shared.reading);
  return shared.recording.dataset.remarks();
}

void bind_open_dataset(py::module_& module) {
  module.def(
      "open_dataset",
      [](const std::filesystem::path& path, const std::string& topic,
         std::optional<bool> labels_are_classes, std::size_t clouds_per_turn) {
        if (clouds_per_turn > TurnJoiner::most)
          throw py::value_error("clouds_per_turn = " + std::to_string(clouds_per_turn) +
                                "; must be 0.." + std::to_string(TurnJoiner::most));
        const py::gil_scoped_release released;
        std::optional<LabelKind> kind;
        if (labels_are_classes)
          kind = *labels_are_classes ? LabelKind::classes : LabelKind::semantic_kitti;
        auto shared = std::make_unique<SharedRecording>(dds::open_recording(path, topic, kind));
        shared->recording.dataset.join_turns(clouds_per_turn);
        require_semantic_kitti_labels(shared->recording.dataset, path);
        return shared;
      },
      py::arg("path"), py::arg("topic") = "", py::arg("labels_are_classes") = py::none(),
      py::arg("clouds_per_turn") = 0,
      "Opens a KITTI sequence, a folder of .bin, .pcd or .ply files, one such file, or a ROS 2 bag "
      "(SQLite or MCAP). topic: of a bag with several topics of scans. labels_are_classes: True: "
      "its labels are classes 0 to 19; False: they are SemanticKITTI's ids; None: they are ids, "
      "unless they do not look like it. Raises DatasetError, then, too. clouds_per_turn: so many "
      "clouds "
      "that follow each other are a turn of the lidar, and one scan; 1: each is a scan; 0: found "
      "out.");
}

}  // namespace

void bind_dataset(py::module_& module) {
  bind_scan(module);
  bind_sensor(module);
  py::class_<SharedRecording>(
      module, "Dataset", "A sequence or bag, read scan by scan: dataset[3], for scan in dataset.")
      .def("__len__", [](const SharedRecording& shared) { return shared.recording.dataset.size(); })
      .def(
          "__getitem__",
          [](SharedRecording& shared, py::ssize_t index) {
            const std::size_t i = index_from(shared.recording.dataset, index);
            const py::gil_scoped_release released;
            const std::scoped_lock lock(shared.reading);
            return shared.recording.dataset.read(i);
          },
          "Reads a scan. Raises DatasetError for a damaged one; the others can still be read.")
      .def_property_readonly(
          "stamps_ns",
          [](const SharedRecording& shared) {
            const ScanDataset& dataset = shared.recording.dataset;
            std::vector<std::int64_t> stamps_ns(dataset.size());
            for (std::size_t i = 0; i < stamps_ns.size(); ++i) stamps_ns[i] = dataset.stamp_ns(i);
            return array_of<std::int64_t>(std::move(stamps_ns));
          },
          "(n,) int64 [ns].")
      .def_property_readonly(
          "sensor",
          [](const SharedRecording& shared) { return shared.recording.dataset.suggested_sensor(); },
          "The sensor as the recording suggests it, for a Mapper.")
      .def_property_readonly(
          "truth",
          [](const SharedRecording& shared) -> std::optional<PythonTrajectory> {
            const auto truth = shared.recording.dataset.truth();
            return truth ? std::optional(trajectory_of(*truth)) : std::nullopt;
          },
          "True poses of the lidar in the frame of the first one, or None.")
      .def_property_readonly(
          "imu", [](SharedRecording& shared) { return imu_arrays(imu_of(shared)); },
          "(stamp_ns (n,) int64, angular_velocity_imu (n, 3) [rad/s], acceleration_imu (n, 3) "
          "[m/s^2]).")
      .def_property_readonly(
          "faults", [](const SharedRecording& shared) { return shared.recording.faults; },
          "What of a bag cannot be read at all, in words.")
      .def_property_readonly(
          "remarks", &remarks_of,
          "What was understood or taken for granted, in words: from which fields intensity, times "
          "and rings are; that files whose names tell no time follow each other by 0.1 s; that "
          "coordinates can be no metres; that scans are parts of a turn, or that another axis than "
          "z is up. Reads some scans.");
  bind_open_dataset(module);
}

py::tuple imu_arrays(const std::vector<ImuSample>& samples) {
  std::vector<std::int64_t> stamps_ns;
  std::vector<Eigen::Vector3d> rates, accelerations;
  for (const ImuSample& sample : samples) {
    stamps_ns.push_back(sample.stamp_ns);
    rates.push_back(sample.angular_velocity_imu);
    accelerations.push_back(sample.acceleration_imu);
  }
  return py::make_tuple(array_of<std::int64_t>(std::move(stamps_ns)),
                        array_of<double>(std::move(rates), 3),
                        array_of<double>(std::move(accelerations), 3));
}

}  // namespace stillmap::python
