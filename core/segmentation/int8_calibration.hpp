#pragma once

#include <map>
#include <string>
#include <vector>

namespace stillmap {

/// What must be known of a network to run it with 8-bit integers; int8.yaml in a model folder.
struct Int8Calibration {
  /// From what, in words.
  std::string made;
  /// Largest magnitude that counts of each channel of each tensor; larger values are cut off. By
  /// the tensor's name in the network's file.
  std::map<std::string, std::vector<float>> range_of_channels;
  /// Layers that stay in floating point, besides the first and the last.
  std::vector<std::string> float_layers;
};

}  // namespace stillmap
