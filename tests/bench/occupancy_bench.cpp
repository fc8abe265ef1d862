#include <benchmark/benchmark.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>

#include "core/dataset/scan_dataset.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/mapper.hpp"
#include "core/occupancy/occupancy_map.hpp"
#include "core/occupancy/octomap_file.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulation.hpp"

// One sequence, mapped into the static map and into an octree. STILLMAP_BENCH_DATA names a dataset
// folder; without it, a simulated sequence with an HDL-64E.

namespace stillmap {
namespace {

namespace fs = std::filesystem;

double heap_bytes() {
  malloc_trim(0);
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd);
}

/// Heap bytes of what `make` returns.
template <class Make>
double heap_bytes_of(Make make) {
  const double before = heap_bytes();
  const auto made = make();
  return heap_bytes() - before;
}

/// The scans of a dataset or a simulation.
class Sequence {
 public:
  Sequence() {
    if (const char* folder = std::getenv("STILLMAP_BENCH_DATA"); folder != nullptr) {
      dataset_.emplace(folder);
      return;
    }
    simulation::SimulationConfig config;
    config.plan = simulation::city_plan("quiet");
    config.scans = 100;
    simulation_.emplace(config);
  }
  [[nodiscard]] std::size_t size() const { return dataset_ ? dataset_->size() : 100; }
  [[nodiscard]] Scan scan(std::size_t i) const {
    return dataset_ ? dataset_->read(i).scan : simulation_->scan(static_cast<int>(i)).scan;
  }
  [[nodiscard]] SensorModel sensor() const {
    return dataset_ ? dataset_->suggested_sensor() : hdl_64e();
  }

 private:
  std::optional<ScanDataset> dataset_;
  std::optional<simulation::Simulation> simulation_;
};

struct Times {
  std::vector<double> ms;

  void report(benchmark::State& state, const std::string& name) {
    if (ms.empty()) return;
    std::ranges::sort(ms);
    state.counters[name + "_p50_ms"] = ms[ms.size() / 2];
    state.counters[name + "_max_ms"] = ms.back();
  }
};

/// The maps after the sequence, and the time of each insertion.
struct MappedSequence {
  MappedSequence() {
    const Sequence sequence;
    MapperConfig config;
    config.sensor = sequence.sensor();
    Mapper mapper(config, std::make_unique<PassthroughSegmenter>());
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      const auto mapped = mapper.process(sequence.scan(i));
      if (!mapped) continue;
      points += static_cast<double>(mapped->labelled.scan.size());
      insert(*mapped);
    }
    stored.view = *mapper.map_snapshot();
    for (const auto& tile : stored.view.tiles) voxels += static_cast<double>(tile->voxels.size());
  }

  void insert(const MappedScan& mapped) {
    const bool clears = scans++ % OccupancyConfig{}.clearing_interval == 0;
    const auto began = std::chrono::steady_clock::now();
    const std::clock_t processor_began = std::clock();
    octree.insert(mapped.labelled, mapped.odometry.T_map_lidar);
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - began;
    (clears ? clearing : hits_only).ms.push_back(took.count());
    all_ms += took.count();
    processor_ms += 1000.0 * static_cast<double>(std::clock() - processor_began) / CLOCKS_PER_SEC;
  }

  OccupancyMap octree{OccupancyConfig{}};
  SavedMap stored;
  double voxels = 0.0;
  double points = 0.0;
  std::size_t scans = 0;
  double all_ms = 0.0;
  /// Processor time, which does not depend on the machine's load.
  double processor_ms = 0.0;
  Times clearing;
  Times hits_only;
};

MappedSequence& mapped_sequence() {
  static MappedSequence sequence;
  return sequence;
}

/// Time of insertion, for scans that clear and for the others.
void insert_sequence(benchmark::State& state) {
  MappedSequence& mapped = mapped_sequence();
  for (auto _ : state) state.SetIterationTime(mapped.all_ms / 1000.0);
  const auto scans = static_cast<double>(mapped.scans);
  state.counters["scans"] = scans;
  state.counters["points_a_scan"] = mapped.points / scans;
  state.counters["mean_ms"] = mapped.all_ms / scans;
  state.counters["mean_processor_ms"] = mapped.processor_ms / scans;
  mapped.clearing.report(state, "clearing");
  mapped.hits_only.report(state, "hits_only");
}
BENCHMARK(insert_sequence)->UseManualTime()->Iterations(1)->Unit(benchmark::kMillisecond);

double file_bytes(const fs::path& file) {
  const auto bytes = static_cast<double>(fs::file_size(file));
  fs::remove(file);
  return bytes;
}

double octomap_file_bytes(const OccupancyMap& map, const char* name) {
  const fs::path file = fs::temp_directory_path() / name;
  write_octomap_file(file, map.encode(octomap_encoding_of(file)));
  return file_bytes(file);
}

void report_octree(benchmark::State& state, const OccupancyMap& map, double voxels) {
  const double heap =
      heap_bytes_of([&] { return OccupancyMap(map.encode(OctomapEncoding::full)); });
  state.counters["voxels"] = voxels;
  state.counters["nodes"] = static_cast<double>(map.size().nodes);
  state.counters["memory_usage_MiB"] = static_cast<double>(map.size().memory_bytes) / 1048576.0;
  state.counters["heap_bytes_a_voxel"] = heap / voxels;
  state.counters["usage_bytes_a_voxel"] = static_cast<double>(map.size().memory_bytes) / voxels;
  state.counters["bt_bytes_a_voxel"] = octomap_file_bytes(map, "occupancy_bench.bt") / voxels;
  state.counters["ot_bytes_a_voxel"] = octomap_file_bytes(map, "occupancy_bench.ot") / voxels;
}

/// Size of the static map: on disk, of a snapshot, and of a live map with its snapshot.
void static_map_size(benchmark::State& state) {
  const MappedSequence& mapped = mapped_sequence();
  for (auto _ : state) {
    const fs::path file = fs::temp_directory_path() / "occupancy_bench.stillmap";
    fs::remove(file);
    open_map_file(file)->save(mapped.stored);
    state.counters["disk_bytes_a_voxel"] = file_bytes(file) / mapped.voxels;
  }
  const double heap = heap_bytes_of([&] {
    auto map = std::make_unique<StaticMap>(StaticMapConfig{});
    map->resume(mapped.stored.view);
    return map;
  });
  state.counters["voxels"] = mapped.voxels;
  state.counters["live_bytes_a_voxel"] = heap / mapped.voxels;
  double view_bytes = 0.0;
  for (const auto& tile : mapped.stored.view.tiles) {
    view_bytes += static_cast<double>(tile->voxels.memory_bytes());
  }
  state.counters["view_bytes_a_voxel"] = view_bytes / mapped.voxels;
}
BENCHMARK(static_map_size)->Iterations(1)->Unit(benchmark::kMillisecond);

/// Size of an octree of the same voxels.
void octree_of_static_map_size(benchmark::State& state) {
  const MappedSequence& mapped = mapped_sequence();
  OccupancyMap map(OccupancyConfig{});
  for (auto _ : state) map.insert(mapped.stored.view);
  report_octree(state, map, mapped.voxels);
}
BENCHMARK(octree_of_static_map_size)->Iterations(1)->Unit(benchmark::kMillisecond);

/// Size of the sequence's octree with its occupied and free voxels, and the share of the static map
/// that is occupied in it.
void octree_of_sequence_size(benchmark::State& state) {
  const MappedSequence& mapped = mapped_sequence();
  const Eigen::Vector3d far = Eigen::Vector3d::Constant(3000.0);
  BoxOccupancy all;
  for (auto _ : state) all = mapped.octree.in_box({-far, far}, 0);
  double kept = 0.0;
  for (const auto& tile : mapped.stored.view.tiles) {
    kept += static_cast<double>(std::ranges::count_if(tile->voxels, [&](const Voxel& voxel) {
      return mapped.octree.at_point(voxel.mean_map.cast<double>()).occupancy == Occupancy::occupied;
    }));
  }
  report_octree(state, mapped.octree, static_cast<double>(all.occupied + all.free));
  state.counters["occupied"] = static_cast<double>(all.occupied);
  state.counters["static_kept_share"] = kept / mapped.voxels;
}
BENCHMARK(octree_of_sequence_size)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace stillmap
