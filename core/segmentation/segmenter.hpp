#pragma once

#include <Eigen/Geometry>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap {

/// How the processor's cores share the work.
enum class Parallelism : std::uint8_t {
  /// All cores work on one scan: its labels come soonest where the cores are free.
  within_scan,
  /// Each core has a scan of its own. No thread waits for another one, which has to wait for its
  /// turn beside other programs: the most scans a second.
  across_scans,
};

/// Source of the points' classes: labels that come with the scans, a network, or none.
class Segmenter {
 public:
  virtual ~Segmenter() = default;

  /// Name for the status: "stream", "none", or the model's name.
  [[nodiscard]] virtual std::string name() const = 0;

  /// Engine and image size in words for the log; may be empty.
  [[nodiscard]] virtual std::string details() const { return {}; }

  /// Time per scan at each resolution level, relative to the finest, which comes first; strictly
  /// decreasing.
  [[nodiscard]] virtual std::vector<double> relative_costs() const { return {1.0}; }
  /// Sets the resolution for the next scans: an index into relative_costs().
  virtual void set_resolution_level(std::size_t /*resolution_level*/) {}
  /// How many scans it works on at a time with Parallelism::across_scans, each asked for by a
  /// thread of its own. 1: segment() is for one thread, and set_parallelism() does nothing.
  [[nodiscard]] virtual std::size_t concurrent_scans() const { return 1; }
  /// For the next scans. May be called while segment() works.
  virtual void set_parallelism(Parallelism /*parallelism*/) {}
  /// Current width of its range images; 0 when it uses none.
  [[nodiscard]] virtual int image_columns() const { return 0; }

  /// Whether the scan brings its labels: then segment() takes no time, and may be called beside
  /// other calls.
  [[nodiscard]] virtual bool has_labels(const Scan& /*scan*/) const { return false; }
  /// Classes of the scan's points; empty when there are none for this scan.
  [[nodiscard]] virtual PointLabels segment(const Scan& scan) = 0;

  /// How the lidar of the next scans sits on its robot, whose z axis points up from the ground;
  /// without it, upright, at a height that is not known. Nor is it with a z below 0.1 m. May be
  /// called while segment() works.
  virtual void set_mount(const Eigen::Isometry3d& /*T_base_lidar*/) {}
};

/// Labels that come with the scan, from a dataset or a point cloud's label field, with confidence 1
/// (0 for unlabeled points). No labels for a scan without them, or without one known class.
class PassthroughSegmenter final : public Segmenter {
 public:
  [[nodiscard]] std::string name() const override { return "stream"; }
  [[nodiscard]] PointLabels segment(const Scan& scan) override;
};

/// No labels, even if the scan has some: a map of geometry alone.
class NullSegmenter final : public Segmenter {
 public:
  [[nodiscard]] std::string name() const override { return "none"; }
  [[nodiscard]] PointLabels segment(const Scan& /*scan*/) override { return {}; }
};

/// The labels that come with the scan; for scans without one known class those of another
/// segmenter.
class FallbackSegmenter final : public Segmenter {
 public:
  explicit FallbackSegmenter(std::unique_ptr<Segmenter> fallback);

  [[nodiscard]] std::string name() const override;
  [[nodiscard]] std::string details() const override { return fallback_->details(); }
  [[nodiscard]] std::vector<double> relative_costs() const override {
    return fallback_->relative_costs();
  }
  void set_resolution_level(std::size_t resolution_level) override {
    fallback_->set_resolution_level(resolution_level);
  }
  [[nodiscard]] std::size_t concurrent_scans() const override {
    return fallback_->concurrent_scans();
  }
  void set_parallelism(Parallelism parallelism) override {
    fallback_->set_parallelism(parallelism);
  }
  [[nodiscard]] int image_columns() const override {
    return uses_stream_ ? 0 : fallback_->image_columns();
  }
  [[nodiscard]] bool has_labels(const Scan& scan) const override {
    return has_known_class(scan.labels);
  }
  [[nodiscard]] PointLabels segment(const Scan& scan) override;
  void set_mount(const Eigen::Isometry3d& T_base_lidar) override {
    fallback_->set_mount(T_base_lidar);
  }

 private:
  std::unique_ptr<Segmenter> fallback_;
  /// The last scan had labels of its own.
  std::atomic<bool> uses_stream_ = false;
};

}  // namespace stillmap
