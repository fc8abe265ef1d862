#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/segmentation/lidar_tilt.hpp"
#include "core/segmentation/model_description.hpp"
#include "core/segmentation/open_network.hpp"
#include "core/segmentation/segmentation_network.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap {

/// The classes of a network's outputs; unlabeled for PixelOutputs::no_output.
[[nodiscard]] PixelLabels pixel_labels(PixelOutputs&& outputs, const ModelDescription& model);

/// The classes of the points of an image from those of its pixels, by the votes that the model asks
/// for: of the pixels around a point, then in voxels. `points` are those of the image, along axes
/// in which the ground is level.
[[nodiscard]] PointLabels voted_labels(const RangeImage& image, const PixelLabels& pixels,
                                       std::span<const Eigen::Vector3f> points,
                                       const ModelDescription& model);

/// Labels from a network on range images (RangeNet++): projection, inference, votes of the
/// pixels around a point and of the voxels.
class NetworkSegmenter final : public Segmenter {
 public:
  /// `network` was opened for `model`, which has no faults. `remark` is appended to details().
  NetworkSegmenter(ModelDescription model, std::unique_ptr<SegmentationNetwork> network,
                   std::string remark = {});

  /// Opens the model's network for one thread, with so many columns. Throws ModelError.
  using OpenOneThreaded = std::function<std::unique_ptr<SegmentationNetwork>(int columns)>;
  /// Lets so many scans be segmented at a time. Their networks are opened when they are first
  /// wanted; while one cannot be, scans take turns with the network of all threads.
  void allow_concurrent_scans(std::size_t scans, OpenOneThreaded open);

  /// Adds a resolution level: the same model with fewer columns than all levels before.
  void add_lower_resolution(int columns, std::unique_ptr<SegmentationNetwork> network);

  [[nodiscard]] std::string name() const override { return model_.name; }
  [[nodiscard]] std::string details() const override;
  [[nodiscard]] std::vector<double> relative_costs() const override;
  void set_resolution_level(std::size_t resolution_level) override;
  [[nodiscard]] std::size_t concurrent_scans() const override { return concurrent_scans_; }
  void set_parallelism(Parallelism parallelism) override;
  [[nodiscard]] int image_columns() const override;
  [[nodiscard]] PointLabels segment(const Scan& scan) override;
  void set_mount(const Eigen::Isometry3d& T_base_lidar) override;

 private:
  using Networks = std::vector<std::unique_ptr<SegmentationNetwork>>;
  struct Level {
    int columns = 0;
    /// Of all threads.
    std::unique_ptr<SegmentationNetwork> network;
    /// Of one thread each, those that do not run.
    Networks idle;
  };

  /// Where the lidar is on its robot.
  struct Mount {
    LidarTilt tilt;
    /// Above the ground, where that is known.
    std::optional<double> height_m;
  };

  struct View;
  [[nodiscard]] View view_of(const Scan& scan, const Mount& mount) const;
  /// Where nobody told a mount: what these points show of it.
  void look_for_mount(std::span<const Eigen::Vector3f> points, View& view) const;
  [[nodiscard]] PointLabels segment_with(SegmentationNetwork& network, int columns,
                                         const Mount& mount, const Scan& scan) const;
  /// What brings z to the heights that the model has seen [m].
  [[nodiscard]] float raised_m(const Mount& mount) const;
  /// A network of one thread that does not run; nothing where the model cannot be opened any more.
  [[nodiscard]] std::unique_ptr<SegmentationNetwork> take_one_threaded(std::size_t level);

  const ModelDescription model_;
  std::string remark_;
  std::size_t concurrent_scans_ = 1;
  OpenOneThreaded open_one_threaded_;
  std::vector<Level> levels_;
  /// Of all below, and of the idle networks.
  mutable std::mutex mutex_;
  Parallelism parallelism_ = Parallelism::within_scan;
  std::size_t current_level_ = 0;
  Mount mount_;
  /// Held while a network of all threads runs.
  std::mutex all_threads_;
};

/// Loads the network that `model` describes. Throws ModelError naming the file and the fault.
[[nodiscard]] std::unique_ptr<Segmenter> open_model(const ModelDescription& model,
                                                    const EngineOptions& choice = {});
/// The same with resolution levels down to the model's min_columns, where it has any.
[[nodiscard]] std::unique_ptr<Segmenter> open_multi_resolution_model(
    const ModelDescription& model, const EngineOptions& choice = {});

}  // namespace stillmap
