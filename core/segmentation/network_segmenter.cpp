#include "core/segmentation/network_segmenter.hpp"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <system_error>
#include <utility>
#include <vector>

#include "core/lidar/measured_elevation.hpp"
#include "core/lidar/range_image.hpp"
#include "core/lidar/ranked_value.hpp"
#include "core/segmentation/beam_origin.hpp"
#include "core/segmentation/ground_votes.hpp"
#include "core/segmentation/lidar_stance.hpp"
#include "core/segmentation/mirrored_view.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/network_input.hpp"

namespace stillmap {
namespace {

/// Networks have seen lidars that fire about once a column. One that fires at fewer azimuths (an
/// Ouster 1024 times a revolution, a VLP-16 at 20 Hz) leaves every other column empty, and edges
/// everywhere: such gaps are filled. Real lidars have shares up to 0.17 in images of their width,
/// and 0.4 and more where they fire half as often.
constexpr double max_share_in_gaps = 0.25;
constexpr int max_gap = 3;

/// RangeNet++ halves the width of its image five times.
constexpr int usual_stride = 32;

/// Half way between the model's smallest and its usual width.
int intermediate_columns(const ModelDescription& model) {
  return (model.columns + model.min_columns) / 2 / usual_stride * usual_stride;
}

std::unique_ptr<SegmentationNetwork> open_with_columns(ModelDescription model, int columns,
                                                       const EngineOptions& choice) {
  model.columns = columns;
  try {
    return open_network(model, choice).network;
  } catch (const ModelError& error) {
    throw ModelError("with " + std::to_string(columns) + " image columns", error.what());
  }
}

/// The robot's origin is on the ground, as maps have it. A mount at that height says nothing of it,
/// and no vehicle carries its lidar higher than the highest here.
std::optional<double> height_above_ground_m(const Eigen::Isometry3d& T_base_lidar) {
  constexpr double lowest_m = 0.1, highest_m = 4.0;
  const double height_m = T_base_lidar.translation().z();
  if (height_m < lowest_m || height_m > highest_m) return std::nullopt;
  return height_m;
}

/// Lowest and highest elevation [rad], but for one point in a thousand at either end. Nothing where
/// they lie too close together for an image.
std::optional<std::pair<double, double>> field_of_view(std::span<const Eigen::Vector3f> points) {
  constexpr double least_rad = 0.02;
  std::vector<double> elevations;
  for (const Eigen::Vector3f& p : points) {
    const double elevation = measured_elevation(p);
    if (std::isfinite(elevation)) elevations.push_back(elevation);
  }
  if (elevations.empty()) return std::nullopt;
  const std::size_t cut = elevations.size() / 1000;
  const double lowest = ranked_value(elevations, cut);
  const std::pair field(lowest, ranked_value(elevations, elevations.size() - 1 - cut));
  return field.second - field.first > least_rad ? std::optional(field) : std::nullopt;
}

/// What brings z to heights that the model has seen, of a lidar that the ground shows so much
/// higher than that [m]: nothing of what such lidars differ by among themselves, all of what only
/// another vehicle explains, and a part of it between, since a height lies now on this side of any
/// step and now on that.
float seen_raise_m(double higher_m) {
  constexpr double usual_m = 0.15, other_m = 0.45;
  const double share = std::clamp((std::abs(higher_m) - usual_m) / (other_m - usual_m), 0.0, 1.0);
  return static_cast<float>(share * higher_m);
}

PointLabels labels_of_own_pixel(const RangeImage& image, const PixelLabels& pixels) {
  return {.classes = unproject(image, std::span<const SemanticClass>(pixels.classes),
                               SemanticClass::unlabeled),
          .confidence = unproject(image, std::span<const float>(pixels.confidence), 0.0F)};
}

}  // namespace

PixelLabels pixel_labels(PixelOutputs&& outputs, const ModelDescription& model) {
  PixelLabels pixels{.classes = std::vector<SemanticClass>(outputs.output.size()),
                     .confidence = std::move(outputs.confidence)};
  std::ranges::transform(outputs.output, pixels.classes.begin(), [&model](std::uint8_t output) {
    return output == PixelOutputs::no_output ? SemanticClass::unlabeled : model.classes[output];
  });
  return pixels;
}

PointLabels voted_labels(const RangeImage& image, const PixelLabels& pixels,
                         std::span<const Eigen::Vector3f> points, const ModelDescription& model) {
  PointLabels labels =
      model.knn ? knn_labels(image, pixels, *model.knn) : labels_of_own_pixel(image, pixels);
  if (model.voxel_votes) vote_in_voxels(points, *model.voxel_votes, labels);
  if (model.unsure_votes) vote_where_unsure(points, *model.unsure_votes, labels);
  if (model.island_votes) {
    vote_on_islands(points, *model.island_votes, labels);
    vote_below_vehicles(points, labels);
  }
  return labels;
}

NetworkSegmenter::NetworkSegmenter(ModelDescription model,
                                   std::unique_ptr<SegmentationNetwork> network, std::string remark)
    : model_(std::move(model)), remark_(std::move(remark)) {
  assert(network && model_.faults().empty());
  levels_.push_back({.columns = model_.columns, .network = std::move(network), .idle = {}});
}

void NetworkSegmenter::add_lower_resolution(int columns,
                                            std::unique_ptr<SegmentationNetwork> network) {
  assert(network && columns > 0 && columns < levels_.back().columns);
  levels_.push_back({.columns = columns, .network = std::move(network), .idle = {}});
}

void NetworkSegmenter::allow_concurrent_scans(std::size_t scans, OpenOneThreaded open) {
  assert(scans > 0 && open);
  concurrent_scans_ = scans;
  open_one_threaded_ = std::move(open);
}

// An estimate: cost in proportion to the pixels. Measured with the default model: 0.7 and 0.54 of
// the time at 0.75 and 0.5 of the columns.
std::vector<double> NetworkSegmenter::relative_costs() const {
  std::vector<double> costs;
  for (const Level& level : levels_) {
    costs.push_back(static_cast<double>(level.columns) / levels_.front().columns);
  }
  return costs;
}

void NetworkSegmenter::set_resolution_level(std::size_t resolution_level) {
  const std::scoped_lock lock(mutex_);
  current_level_ = std::min(resolution_level, levels_.size() - 1);
}

void NetworkSegmenter::set_parallelism(Parallelism parallelism) {
  const std::scoped_lock lock(mutex_);
  parallelism_ = parallelism;
}

void NetworkSegmenter::set_mount(const Eigen::Isometry3d& T_base_lidar) {
  const std::scoped_lock lock(mutex_);
  mount_ = {LidarTilt(T_base_lidar.linear()), height_above_ground_m(T_base_lidar)};
}

float NetworkSegmenter::raised_m(const Mount& mount) const {
  if (!mount.height_m || !model_.lidar_height_m) return 0.0F;
  return static_cast<float>(*mount.height_m - *model_.lidar_height_m);
}

int NetworkSegmenter::image_columns() const {
  const std::scoped_lock lock(mutex_);
  return levels_[current_level_].columns;
}

std::string NetworkSegmenter::details() const {
  std::string text = levels_.front().network->engine() + ", image " + std::to_string(model_.rows) +
                     "x" + std::to_string(levels_.front().columns);
  if (levels_.size() > 1) text += " down to " + std::to_string(levels_.back().columns);
  if (model_.mirrored) text += ", and mirrored";
  return text + (remark_.empty() ? "" : "; ") + remark_;
}

PointLabels NetworkSegmenter::segment(const Scan& scan) {
  if (scan.empty()) return {};
  std::unique_lock lock(mutex_);
  const std::size_t level = current_level_;
  const int columns = levels_[level].columns;
  const Parallelism parallelism = parallelism_;
  const Mount mount = mount_;
  lock.unlock();
  if (parallelism == Parallelism::across_scans && concurrent_scans_ > 1) {
    if (auto network = take_one_threaded(level)) {
      // The loops of the projection and of the votes in this thread, too.
      tbb::task_arena this_thread(1);
      PointLabels labels =
          this_thread.execute([&] { return segment_with(*network, columns, mount, scan); });
      lock.lock();
      levels_[level].idle.push_back(std::move(network));
      return labels;
    }
  }
  const std::scoped_lock all_threads(all_threads_);
  return segment_with(*levels_[level].network, columns, mount, scan);
}

std::unique_ptr<SegmentationNetwork> NetworkSegmenter::take_one_threaded(std::size_t level) {
  {
    const std::scoped_lock lock(mutex_);
    Networks& idle = levels_[level].idle;
    if (!idle.empty()) {
      auto network = std::move(idle.back());
      idle.pop_back();
      return network;
    }
  }
  try {
    return open_one_threaded_(levels_[level].columns);
  } catch (const ModelError&) {
    // The model was read before: its file is gone, and its network is still here.
    return nullptr;
  }
}

/// How the network is shown a scan.
struct NetworkSegmenter::View {
  /// Empty: as the scan has them.
  std::vector<Eigen::Vector3f> moved_points;
  /// Whether the image is one of these.
  bool moves_image = false;
  ProjectionModel projection;
  /// See raised_m().
  float raised_m = 0.0F;

  /// The image of these, over the elevations that they are at.
  void show_instead(std::vector<Eigen::Vector3f> points) {
    moved_points = std::move(points);
    moves_image = true;
    if (const auto field = field_of_view(moved_points)) {
      projection.fov_down = field->first;
      projection.fov_up = field->second;
    }
  }

  /// These, turned by what the lidar leans.
  void show_turned(std::vector<Eigen::Vector3f> points, const LidarTilt& tilt) {
    moved_points = std::move(points);
    moves_image = tilt.turns_image();
    projection = tilt.widened(projection);
  }
};

NetworkSegmenter::View NetworkSegmenter::view_of(const Scan& scan, const Mount& mount) const {
  View view{.moved_points = {},
            .moves_image = false,
            .projection = model_.projection(),
            .raised_m = raised_m(mount)};
  if (!mount.tilt.is_upright()) {
    std::vector<Eigen::Vector3f> turned = mount.tilt.turned(scan.points_lidar);
    // An image of fixed size is that of the published projection: what a turned one shows would not
    // fit into its field of view.
    if (model_.follow_sensor) {
      view.show_turned(std::move(turned), mount.tilt);
    } else {
      view.moved_points = std::move(turned);
    }
  } else if (model_.finds_stance && model_.follow_sensor && model_.lidar_height_m &&
             !mount.height_m) {
    look_for_mount(scan.points_lidar, view);
  }
  return view;
}

void NetworkSegmenter::look_for_mount(std::span<const Eigen::Vector3f> points, View& view) const {
  if (const auto height_m = lidar_height_over_origin(points, *model_.lidar_height_m)) {
    std::vector<Eigen::Vector3f> lowered(points.begin(), points.end());
    for (Eigen::Vector3f& p : lowered) {
      if (is_measured(p)) p.z() -= static_cast<float>(*height_m);
    }
    view.show_instead(std::move(lowered));
    view.raised_m = static_cast<float>(*height_m - *model_.lidar_height_m);
    return;
  }
  const auto stance = stance_over_ground(points);
  if (!stance) return;
  view.raised_m = seen_raise_m(stance->height_m - *model_.lidar_height_m);
  if (stance->tilt_rad < least_seen_tilt_rad) return;
  const LidarTilt tilt(stance->R_level_lidar);
  std::vector<Eigen::Vector3f> turned = tilt.turned(points);
  // A cloud that was turned after it was measured (to the axes of a robot, say) has its rows where
  // the lidar was upright.
  if (has_fewer_elevations(turned, points)) {
    view.show_instead(std::move(turned));
  } else {
    view.show_turned(std::move(turned), tilt);
  }
}

PointLabels NetworkSegmenter::segment_with(SegmentationNetwork& network, int columns,
                                           const Mount& mount, const Scan& scan) const {
  View view = view_of(scan, mount);
  view.projection.columns = columns;
  const std::span<const Eigen::Vector3f> points =
      view.moved_points.empty() ? scan.points_lidar : view.moved_points;
  const RangeImage image(view.moves_image ? points : scan.points_lidar, view.projection);
  std::optional<RangeImage> filled;
  if (model_.follow_sensor && image.share_in_gaps(max_gap) > max_share_in_gaps)
    filled = image.with_gaps_filled(max_gap);
  const std::vector<float> input =
      make_network_input(points, scan.intensity, filled ? *filled : image, model_, view.raised_m);
  PixelOutputs outputs =
      model_.mirrored ? run_mirrored_too(network, input, static_cast<std::size_t>(image.columns()),
                                         model_.statistics)
                      : network.run(input);
  const PixelLabels pixels = pixel_labels(std::move(outputs), model_);
  return voted_labels(image, pixels, points, model_);
}

namespace {

/// Size and time of change of a file; nothing where it is gone.
std::optional<std::pair<std::uintmax_t, std::filesystem::file_time_type>> version_of(
    const std::filesystem::path& file) {
  std::error_code fault;
  const std::uintmax_t bytes = std::filesystem::file_size(file, fault);
  if (fault) return std::nullopt;
  const auto changed = std::filesystem::last_write_time(file, fault);
  if (fault) return std::nullopt;
  return std::pair(bytes, changed);
}

/// With a network of one thread for each scan at a time, where the engine leaves the choice.
std::unique_ptr<NetworkSegmenter> open_finest(const ModelDescription& model,
                                              const EngineOptions& choice) {
  OpenedNetwork opened = open_network(model, choice);
  const int threads = opened.threads;
  auto segmenter = std::make_unique<NetworkSegmenter>(model, std::move(opened.network),
                                                      std::move(opened.remark));
  if (choice.threads != 0 || threads < 2) return segmenter;
  EngineOptions one_thread = choice;
  one_thread.threads = 1;
  segmenter->allow_concurrent_scans(
      static_cast<std::size_t>(threads),
      [model, one_thread, read = version_of(model.network_file)](int columns) {
        // Not the weights of another training beside those that are in use.
        if (version_of(model.network_file) != read)
          throw ModelError(model.network_file, "was changed since it was read");
        return open_with_columns(model, columns, one_thread);
      });
  return segmenter;
}

}  // namespace

std::unique_ptr<Segmenter> open_model(const ModelDescription& model, const EngineOptions& choice) {
  return open_finest(model, choice);
}

std::unique_ptr<Segmenter> open_multi_resolution_model(const ModelDescription& model,
                                                       const EngineOptions& choice) {
  std::unique_ptr<NetworkSegmenter> segmenter = open_finest(model, choice);
  const int min_columns = model.min_columns;
  if (min_columns == 0 || min_columns >= model.columns) return segmenter;
  if (const int columns = intermediate_columns(model); columns > min_columns) {
    try {
      segmenter->add_lower_resolution(columns, open_with_columns(model, columns, choice));
    } catch (const ModelError&) {
      // This level is optional: a network of a larger stride may not accept its width.
    }
  }
  segmenter->add_lower_resolution(min_columns, open_with_columns(model, min_columns, choice));
  return segmenter;
}

}  // namespace stillmap
