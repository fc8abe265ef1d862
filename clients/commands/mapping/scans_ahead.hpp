#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <future>
#include <memory>
#include <mutex>
#include <stop_token>
#include <thread>
#include <vector>

#include "core/dataset/scan_dataset.hpp"
#include "core/lidar/prepare.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap::cli {

/// Reads the scans of a data set for a mapper and segments them ahead of it, as many at a time as
/// the segmenter takes: nobody waits for a recorded scan, so each is left to one core. With a
/// segmenter that takes scans one by one, all is done when it is asked for. Labels are the same
/// either way.
class ScansAhead {
 public:
  /// `config`: of the mapper, which prepares the scans once more. `dataset` outlives it.
  ScansAhead(const ScanDataset& dataset, const MapperConfig& config,
             std::unique_ptr<Segmenter> segmenter);
  ~ScansAhead();
  ScansAhead(const ScansAhead&) = delete;
  ScansAhead& operator=(const ScansAhead&) = delete;

  /// Begins with scan `first`, and ends before `end`. Once.
  void start(std::size_t first, std::size_t end);

  /// The next scan. Throws DatasetError for one that is damaged; the one after it can be read.
  [[nodiscard]] DatasetFrame read();

  /// For a mapper that gets the scans as they are read: waits for the labels of the last one.
  [[nodiscard]] std::unique_ptr<Segmenter> segmenter();

 private:
  /// A scan that is worked on, or waits to be taken.
  struct Scheduled {
    std::future<DatasetFrame> frame;
    std::future<PointLabels> labels;
  };
  class LabelsOfLastRead;

  void work(const std::stop_token& stop);
  void make(std::size_t index, std::promise<DatasetFrame>& frame,
            std::promise<PointLabels>& labels);
  [[nodiscard]] DatasetFrame read_scan(std::size_t index);

  const ScanDataset& dataset_;
  PrepareConfig prepare_;
  double elevation_offset_;
  std::unique_ptr<Segmenter> segmenter_;
  std::size_t end_ = 0;
  std::future<PointLabels> labels_of_last_read_;
  /// Sources of scans are read by one thread at a time.
  std::mutex reading_;

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::size_t next_read_ = 0;
  std::size_t next_scheduled_ = 0;
  /// Those from `next_read_` up to `next_scheduled_`.
  std::deque<Scheduled> ahead_;
  // Last: they end before what they use is gone.
  std::vector<std::jthread> threads_;
};

}  // namespace stillmap::cli
