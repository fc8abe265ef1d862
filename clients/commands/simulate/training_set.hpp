#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>

namespace stillmap::cli {

/// Which made-up cities a training set has.
struct TrainingSetPlan {
  std::filesystem::path folder;
  int cities = 200;
  std::uint64_t first_seed = 1000;
  int scans_per_city = 8;
  /// Of the drives, as `training_sequence` has it.
  double share_of_plain = 0.4;
};

struct TrainingSetCount {
  int cities = 0;
  /// Of these, complete before the run began.
  int skipped = 0;
  std::uint64_t scans = 0, points = 0;
};

/// Writes `folder`/sequences/SEED for each seed, several cities at a time (oneTBB): a SemanticKITTI
/// sequence and the sensor.yaml of its lidar. Cities that are complete stay as they are; a city
/// appears under its name only when it is.
/// @param after_city called after every city, by one thread at a time; false ends the run.
/// @throws DatasetError, or std::runtime_error that names the file.
TrainingSetCount write_training_set(const TrainingSetPlan& plan,
                                    const std::function<bool(const TrainingSetCount&)>& after_city);

}  // namespace stillmap::cli
