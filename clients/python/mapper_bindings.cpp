#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "clients/python/bindings.hpp"
#include "clients/python/map.hpp"
#include "clients/python/scan.hpp"
#include "config/loaders/model_file.hpp"
#include "config/loaders/sensor_file.hpp"
#include "config/loaders/server_config.hpp"
#include "core/map/map_id.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/mapper.hpp"
#include "core/odometry/motion_trust.hpp"

namespace stillmap::python {
namespace {

LabelsConfig labels_from(LabelsConfig labels, const std::string& source) {
  if (source == "none") {
    labels.source = LabelProvider::none;
  } else if (source == "scan") {
    labels.source = LabelProvider::stream;
  } else {
    labels.source = LabelProvider::model;
    if (source != "model") labels.model = source;
  }
  return labels;
}

/// The lidar's place on the robot, as `stillmap map` takes it from the file.
Eigen::Isometry3d mount_of(const ServerConfig& config, const std::filesystem::path& file) {
  if (!config.lidars.empty()) {
    throw std::invalid_argument(file.string() +
                                " lists several lidars ('sensors'), but a mapper is of one: give a "
                                "file with 'sensor' and 'mount'");
  }
  if (config.frames.base.empty()) return Eigen::Isometry3d::Identity();
  if (config.mount.source == MountConfig::Source::tf_static) {
    throw std::invalid_argument(file.string() +
                                " takes the lidar's place from /tf_static, which a mapper does not "
                                "hear: give it as mount.xyz_m and mount.rpy_deg");
  }
  return config.mount.T_base_lidar;
}

/// A mapper that threads use one after the other.
class SharedMapper {
 public:
  SharedMapper(std::unique_ptr<Mapper> mapper, const MotionLimits& limits)
      : mapper_(std::move(mapper)), trust_(limits) {}

  /// Maps a scan from where a prior has it, as long as priors foretell what is registered. Where
  /// nobody knows where the lidar is, they are believed.
  std::optional<MappedScan> process(const Scan& scan,
                                    const std::optional<Eigen::Isometry3d>& T_map_lidar_prior) {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(mutex_);
    trust_.forget_motion();
    const bool is_used = T_map_lidar_prior && is_believed(scan.stamp_ns, *T_map_lidar_prior);
    auto mapped = mapper_->process(scan, is_used ? T_map_lidar_prior : std::nullopt);
    if (mapped) learn(*mapped);
    return mapped;
  }
  void reset() {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(mutex_);
    mapper_->reset(new_map_id());
    last_.reset();
  }

  /// What `use(Mapper&)` returns. Python goes on meanwhile, and must not be used in it.
  template <typename Use>
  auto with(Use use) {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(mutex_);
    return use(*mapper_);
  }

 private:
  [[nodiscard]] bool is_believed(std::int64_t stamp_ns, const Eigen::Isometry3d& T_map_lidar) {
    return !last_ || (trust_.is_possible(last_->T_map_lidar.inverse() * T_map_lidar,
                                         1e-9 * static_cast<double>(stamp_ns - last_->stamp_ns)) &&
                      trust_.is_believed());
  }
  void learn(const MappedScan& mapped) {
    const StampedPose now{mapped.labelled.scan.stamp_ns, mapped.odometry.T_map_lidar};
    const OdometryHealth health = mapped.odometry.health;
    if (health == OdometryHealth::lost) return last_.reset();
    if (last_ && health == OdometryHealth::good)
      trust_.learn(last_->T_map_lidar.inverse() * now.T_map_lidar,
                   1e-9 * static_cast<double>(now.stamp_ns - last_->stamp_ns));
    last_ = now;
  }

  std::unique_ptr<Mapper> mapper_;
  std::mutex mutex_;
  MotionTrust trust_;
  /// The last pose; nothing before the first, and where the lidar is lost.
  std::optional<StampedPose> last_;
};

std::unique_ptr<SharedMapper> make_mapper(const SensorModel& sensor, const std::string& labels,
                                          const std::optional<std::filesystem::path>& config_file) {
  const py::gil_scoped_release released;
  ServerConfig config;
  Eigen::Isometry3d T_base_lidar = Eigen::Isometry3d::Identity();
  if (config_file) {
    config = load_server_config(*config_file);
    T_base_lidar = mount_of(config, *config_file);
  }
  if (const auto fault = range_fault(sensor, config.automatic_sensor, config.mapper.prepare))
    throw std::invalid_argument("prepare." + fault->field + ": " + fault->text);
  use_sensor(sensor, config.automatic_sensor, config.mapper);
  auto mapper = std::make_unique<Mapper>(
      config.mapper,
      open_segmenter(labels_from(config.labels, labels), sensor, false, T_base_lidar));
  mapper->reset(new_map_id());
  return std::make_unique<SharedMapper>(std::move(mapper), sensor.motion_limits);
}

std::optional<MappedScan> process(SharedMapper& shared, const DatasetFrame& frame,
                                  const std::optional<InArray<double>>& T_map_lidar_prior) {
  std::optional<Eigen::Isometry3d> prior;
  if (T_map_lidar_prior) prior = transform_from(*T_map_lidar_prior, "T_map_lidar_prior");
  return shared.process(frame.scan, prior);
}

Map current_map(Mapper& mapper) {
  Map map{.view = mapper.map_snapshot(),
          .trajectory = mapper.trajectory(),
          .metadata = {},
          .read_evidence = {}};
  auto evidence = std::make_shared<const TileEvidenceMap>(
      to_saved_map(mapper.static_map().checkpoint(CheckpointScope::everything)).tile_evidence);
  map.read_evidence = [evidence] { return *evidence; };
  return map;
}

void save(Mapper& mapper, const std::filesystem::path& file) {
  if (std::filesystem::exists(file)) {
    throw MapFileError(file, "is there already; name a new file, or remove it");
  }
  SavedMap map = to_saved_map(mapper.static_map().checkpoint(CheckpointScope::everything));
  map.trajectory = mapper.trajectory();
  map.is_partial = false;
  map.metadata = {{"label_source", mapper.label_source()}};
  const auto store = open_map_file(file);
  static_cast<void>(store->save(map));
  store->complete_file();
}

void add_imu(SharedMapper& shared, std::int64_t stamp_ns,
             const std::array<double, 3>& angular_velocity_imu,
             const std::array<double, 3>& acceleration_imu) {
  const ImuSample sample{stamp_ns, Eigen::Vector3d(angular_velocity_imu.data()),
                         Eigen::Vector3d(acceleration_imu.data())};
  shared.with([&](Mapper& mapper) { mapper.add(sample); });
}

void bind_mapped_scan(py::module_& module) {
  py::class_<MappedScan>(module, "MappedScan", "What became of a scan.")
      .def_property_readonly(
          "T_map_lidar", [](const MappedScan& s) { return array_from(s.odometry.T_map_lidar); },
          "(4, 4) float64: takes points of the lidar frame to the map frame [m].")
      .def_property_readonly(
          "covariance",
          [](const MappedScan& s) { return array_from(Eigen::MatrixXd(s.odometry.covariance)); },
          "(6, 6): of translation [m] and rotation [rad], map frame.")
      .def_property_readonly(
          "health", [](const MappedScan& s) { return std::string(name(s.odometry.health)); },
          "\"initialised\", \"good\", \"degenerate\" (some of the motion is not observable) or "
          "\"lost\" (the pose is a prediction).")
      .def_property_readonly(
          "fit", [](const MappedScan& s) { return s.odometry.fit; },
          "How well the scan lies on the map, 0..1.")
      .def_property_readonly("stamp_ns",
                             [](const MappedScan& s) { return s.labelled.scan.stamp_ns; })
      .def_property_readonly(
          "points_lidar",
          [](const MappedScan& s) { return array_of<float>(s.labelled.scan.points_lidar, 3); },
          "(n, 3) float32: the usable points, motion-compensated, lidar frame [m].")
      .def_property_readonly(
          "label",
          [](const MappedScan& s) { return array_of<std::uint8_t>(s.labelled.labels.classes); },
          "(n,) uint8: index of CLASS_NAMES; empty without labels.")
      .def_property_readonly(
          "confidence",
          [](const MappedScan& s) { return array_of<float>(s.labelled.labels.confidence); },
          "(n,) float32, 0..1.")
      .def_property_readonly(
          "motion", [](const MappedScan& s) { return array_of<std::uint8_t>(s.labelled.motion); },
          "(n,) uint8: index of MOTIONS.")
      .def("__len__", [](const MappedScan& s) { return s.labelled.scan.size(); });
}

/// What a mapper is given.
void bind_inputs(py::class_<SharedMapper>& mapper) {
  mapper
      .def(py::init(&make_mapper), py::arg("sensor"), py::arg("labels") = "none",
           py::arg("config") = py::none(),
           "sensor: a Sensor. labels: \"none\" (pure geometry), \"scan\" (those of the scans), "
           "\"model\" (the network that comes with Stillmap), or a folder with a model. config: a "
           "server file whose mapper settings are used, and whose mount tells the network how the "
           "lidar leans. Raises ConfigError, ValueError.")
      .def(
          "process", &process, py::arg("scan"), py::arg("T_map_lidar_prior") = py::none(),
          "Maps a Scan. T_map_lidar_prior: (4, 4), the last pose times what another odometry has "
          "moved since, replaces the constant-velocity prediction as long as such motions foretell "
          "what is registered, and are no jumps; any does at the start, and after a scan that was "
          "lost. "
          "None for a scan that cannot be mapped; last_rejection says why.")
      .def_property_readonly("last_rejection",
                             [](SharedMapper& shared) {
                               return shared.with([](const Mapper& mapper) {
                                 return std::string(mapper.last_rejection().reason);
                               });
                             })
      .def("add_imu", &add_imu, py::arg("stamp_ns"), py::arg("angular_velocity_imu"),
           py::arg("acceleration_imu"),
           "A sample of the IMU [rad/s, m/s^2], before the scans that end after it.")
      .def(
          "reset", [](SharedMapper& shared) { shared.reset(); },
          "Begins a new map at the next scan, whose pose is its origin; the lidar goes on as it "
          "moved.");
}

/// What it has made of that.
void bind_results(py::class_<SharedMapper>& mapper) {
  mapper
      .def_property_readonly(
          "trajectory",
          [](SharedMapper& shared) {
            return trajectory_of(
                shared.with([](const Mapper& mapper) { return Trajectory(mapper.trajectory()); }));
          },
          "Poses of the lidar so far.")
      .def_property_readonly(
          "label_source",
          [](SharedMapper& shared) {
            return shared.with([](const Mapper& mapper) { return mapper.label_source(); });
          })
      .def(
          "map", [](SharedMapper& shared) { return shared.with(current_map); },
          "The static map as it is now.")
      .def(
          "save",
          [](SharedMapper& shared, const std::filesystem::path& file) {
            shared.with([&](Mapper& mapper) { save(mapper, file); });
          },
          py::arg("file"),
          "Writes a new map file, which servers resume and open_map() reads. Raises "
          "MapFileError.");
}

}  // namespace

void bind_mapper(py::module_& module) {
  module.attr("MOTIONS") = py::make_tuple("stationary", "semi_static", "highly_dynamic");
  bind_mapped_scan(module);
  py::class_<SharedMapper> mapper(
      module, "Mapper",
      "The server's pipeline in this process: poses, classes and a static map of scans, one after "
      "the other. Threads that share it wait for each other.");
  bind_inputs(mapper);
  bind_results(mapper);
}

}  // namespace stillmap::python
