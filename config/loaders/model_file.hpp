#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <memory>
#include <string>

#include "config/loaders/config_error.hpp"
#include "config/loaders/server_config.hpp"
#include "core/segmentation/model_description.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap {

/// Reads model.yaml of a model folder; the network is model.onnx beside it. Throws ConfigError with
/// every fault.
[[nodiscard]] ModelDescription load_uncalibrated_model(const std::filesystem::path& folder);
/// The same with its calibration, where there is an int8.yaml.
[[nodiscard]] ModelDescription load_model_description(const std::filesystem::path& folder);

/// The label source that the configuration asks for, for scans of this sensor. `adaptive_width`:
/// able to look more coarsely, where the model can and the configuration does not say how finely.
/// `T_base_lidar`: where the lidar sits on its robot, as far as that is known (see
/// Segmenter::set_mount). Throws ConfigError or ModelError.
[[nodiscard]] std::unique_ptr<Segmenter> open_segmenter(
    const LabelsConfig& labels, const SensorModel& sensor, bool adaptive_width = false,
    const Eigen::Isometry3d& T_base_lidar = Eigen::Isometry3d::Identity());

/// What to tell, once, where the network of another model that known_models() lists was trained for
/// lidars more like this one than the configured one: its name, both models' lidars and its
/// licence. Empty where there is none, or no network is asked for. Throws ConfigError for the
/// configured model.
[[nodiscard]] std::string better_model(const LabelsConfig& labels, const SensorModel& sensor);

}  // namespace stillmap
