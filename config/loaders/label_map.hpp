#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "config/loaders/config_error.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// What the numbers of a labelled data set mean to Stillmap.
struct LabelMap {
  struct Entry {
    /// The data set's own name of the number.
    std::string name;
    SemanticClass label = SemanticClass::unlabeled;
    /// What such an object did while it was recorded. Truth for evaluation, never an input to
    /// odometry or map.
    Motion motion = Motion::stationary;
  };

  std::string name;
  std::map<std::uint16_t, Entry> entries;

  /// `unlabeled` for a number that is not in the map.
  [[nodiscard]] SemanticClass class_of(std::uint16_t raw_label) const;
};

/// Reads a label file like config/labels/semantic_kitti.yaml. Throws ConfigError with every fault.
[[nodiscard]] LabelMap load_label_map(const std::filesystem::path& file);

}  // namespace stillmap
