#include "clients/commands/simulate/training_set.hpp"

#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_group.h>

#include <mutex>
#include <string>
#include <system_error>

#include "config/loaders/sensor_file.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/kitti_sequence_writer.hpp"
#include "core/simulation/training_city.hpp"

namespace stillmap::cli {
namespace {

namespace fs = std::filesystem;

std::string sequence_name(std::uint64_t seed) {
  const std::string digits = std::to_string(seed);
  return std::string(digits.size() < 4 ? 4 - digits.size() : 0, '0').append(digits);
}

// One city, written aside and then put in its place.
TrainingSetCount write_city(const fs::path& sequence, std::uint64_t seed,
                            const TrainingSetPlan& plan) {
  const fs::path unfinished = fs::path(sequence).concat(".unfinished");
  fs::remove_all(unfinished);
  const simulation::Simulation drive(simulation::training_sequence(seed, plan.share_of_plain));
  KittiSequenceWriter writer(unfinished);
  TrainingSetCount count{.cities = 1};
  for (const int index : simulation::spread_scans(drive, plan.scans_per_city)) {
    const simulation::SimulatedScan scan = drive.scan(index);
    writer.add(scan.scan, scan.raw_labels, scan.T_map_lidar);
    count.scans += 1;
    count.points += scan.scan.size();
  }
  writer.finish();
  save_sensor(drive.config().sensor, unfinished / "sensor.yaml");
  fs::rename(unfinished, sequence);
  return count;
}

}  // namespace

TrainingSetCount write_training_set(
    const TrainingSetPlan& plan, const std::function<bool(const TrainingSetCount&)>& after_city) {
  std::error_code error;
  fs::create_directories(plan.folder / "sequences", error);
  if (error) throw DatasetError(plan.folder, "cannot be made: " + error.message());
  std::mutex mutex;
  TrainingSetCount total;
  tbb::task_group_context run;
  const auto add = [&](const TrainingSetCount& city) {
    const std::lock_guard lock(mutex);
    total.cities += city.cities;
    total.skipped += city.skipped;
    total.scans += city.scans;
    total.points += city.points;
    if (!after_city(total)) run.cancel_group_execution();
  };
  const auto write = [&](int index) {
    const std::uint64_t seed = plan.first_seed + static_cast<std::uint64_t>(index);
    const fs::path sequence = plan.folder / "sequences" / sequence_name(seed);
    add(fs::exists(sequence) ? TrainingSetCount{.cities = 1, .skipped = 1}
                             : write_city(sequence, seed, plan));
  };
  tbb::parallel_for(0, plan.cities, write, tbb::simple_partitioner(), run);
  return total;
}

}  // namespace stillmap::cli
