#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <string>

#include "clients/terminal/command_line.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/open_network.hpp"

namespace stillmap::cli {

/// How a command line says what runs a network; empty: as configured.
struct EngineArguments {
  std::string engine;
  std::string precision;
  /// 0: as configured.
  std::uint32_t threads = 0;
};

/// Adds --engine, --precision and --threads.
void add_engine_options(CommandHandle command, EngineArguments& arguments);

/// Puts what the command line says in place of `choice`.
void set_engine(const EngineArguments& arguments, EngineOptions& choice);

/// How a command line asks for a mapper.
struct MapperArguments {
  /// Server file whose mapper and labels sections are taken; empty: the defaults.
  std::string config_file;
  /// Name or file, or "auto": as the dataset suggests; empty: that of `config_file`, else so, too.
  std::string sensor;
  /// "auto", "files", "model" (the default one), "none", or a model folder.
  std::string labels = "auto";
  /// "none", "geometric", "semantic"; empty: as configured.
  std::string weighting;
  /// Of the network's range image; 0: as configured.
  std::uint32_t columns = 0;
  EngineArguments engine;
  /// "auto" or "mount"; empty: as configured.
  std::string stance;
  /// "on" or "off": whether the network sees each scan in a mirror, too; empty: as configured.
  std::string mirrored;

  /// Whether `sensor` is one, and not left to the dataset.
  [[nodiscard]] bool names_sensor() const;
};

/// Adds --columns, --engine, --precision, --threads, --stance and --mirrored.
void add_segmentation_options(CommandHandle command, MapperArguments& arguments);
/// Adds these and --config, --sensor, --labels, --weighting.
void add_mapper_options(CommandHandle command, MapperArguments& arguments);

[[nodiscard]] const char* name(Weighting weighting);
/// Throws std::invalid_argument.
[[nodiscard]] Weighting weighting_from_name(const std::string& weighting_name);

/// Throws ConfigError or std::invalid_argument.
[[nodiscard]] MapperConfig mapper_config(const MapperArguments& arguments,
                                         const SensorModel& suggested_sensor);
/// What says that it is this sensor: "option", "configuration" or "scans". Throws ConfigError.
[[nodiscard]] std::string sensor_origin(const MapperArguments& arguments);
/// For scans of a lidar that sits there on its robot; without, upright. Throws ConfigError,
/// ModelError or std::invalid_argument.
[[nodiscard]] std::unique_ptr<Segmenter> make_segmenter(
    const MapperArguments& arguments, const ScanDataset& dataset,
    const Eigen::Isometry3d& T_base_lidar = Eigen::Isometry3d::Identity());
/// Lines that tell which model labels the scans, and whether another one was trained for lidars
/// more like theirs; without a network, whether some scans stay without labels.
[[nodiscard]] std::string describe_model(const MapperArguments& arguments,
                                         const ScanDataset& dataset, const Segmenter& segmenter);
/// A line that tells why most of the data set's scans cannot come from this sensor; empty when they
/// can.
[[nodiscard]] std::string describe_sensor_mismatch(const ScanDataset& dataset,
                                                   const SensorModel& sensor);

}  // namespace stillmap::cli
