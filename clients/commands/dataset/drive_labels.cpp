#include "clients/commands/dataset/drive_labels.hpp"

#include <memory>
#include <utility>

#include "core/segmentation/segmenter.hpp"

namespace stillmap::cli {
namespace {

/// Nobody reads the static map: of no points it takes neither memory nor time.
MapperConfig without_static_map(MapperConfig config) {
  constexpr double nothing_m = 1e-3;
  config.static_map.max_range_m = nothing_m;
  config.static_map.clearing_range_m = 0.0;
  return config;
}

}  // namespace

OptionHandle add_drive_votes_option(CommandHandle command, std::string& drive_votes) {
  return command
      .option("--drive-votes", drive_votes,
              "on (default): labels that a model finds are voted on by the scans before and after, "
              "where "
              "odometry can tell how they lie to each other; off: each scan's as found alone")
      .one_of({"on", "off"});
}

void mirror_with_drive_votes(const std::string& drive_votes, MapperArguments& mapper) {
  if (drive_votes != "off" && mapper.mirrored.empty()) mapper.mirrored = "on";
}

void DriveLabels::add(const MappedScan& mapped, PointLabels labels) {
  const OdometryHealth health = mapped.odometry.health;
  const bool has_pose = health == OdometryHealth::initialised || health == OdometryHealth::good;
  // Nothing says how it lies to those of before.
  if (health == OdometryHealth::initialised) votes_.finish();
  votes_.add(mapped.labelled.scan.points_lidar, std::move(labels),
             is_voted_ && has_pose ? std::optional(mapped.odometry.T_map_lidar) : std::nullopt);
}

void DriveLabels::pass(const std::optional<MappedScan>& mapped) {
  if (!mapped || mapped->odometry.health != OdometryHealth::good) votes_.finish();
}

DriveScans::DriveScans(const MapperConfig& config)
    : prepare_(config.prepare),
      mapper_(without_static_map(config),
              std::unique_ptr<Segmenter>(std::make_unique<NullSegmenter>())) {}

void DriveScans::add(const Scan& scan, std::optional<PointLabels> labels) {
  is_begun_ = true;
  const std::optional<MappedScan> mapped = mapper_.process(scan);
  if (!labels) return votes_.pass(mapped);
  std::vector<std::uint32_t> usable = usable_points(scan, prepare_);
  if (labels->empty()) usable.clear();
  PointLabels of_usable;
  of_usable.classes.reserve(usable.size());
  of_usable.confidence.reserve(usable.size());
  for (const std::uint32_t point : usable) {
    of_usable.classes.push_back(labels->classes[point]);
    of_usable.confidence.push_back(labels->confidence[point]);
  }
  waiting_.push_back({std::move(*labels), std::move(usable)});
  if (mapped && mapped->labelled.scan.size() == of_usable.classes.size()) {
    votes_.add(*mapped, std::move(of_usable));
  } else {
    votes_.add_without_pose(std::move(of_usable));
  }
}

void DriveScans::leave() {
  if (!is_begun_) return;
  finish();
  mapper_.reset(++maps_);
  is_begun_ = false;
}

std::optional<PointLabels> DriveScans::take() {
  const std::optional<PointLabels> voted = votes_.take();
  if (!voted) return std::nullopt;
  Waiting oldest = std::move(waiting_.front());
  waiting_.pop_front();
  for (std::size_t i = 0; i < oldest.usable.size(); ++i) {
    oldest.of_all.classes[oldest.usable[i]] = voted->classes[i];
    oldest.of_all.confidence[oldest.usable[i]] = voted->confidence[i];
  }
  return std::move(oldest.of_all);
}

}  // namespace stillmap::cli
