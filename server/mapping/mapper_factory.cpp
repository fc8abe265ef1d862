#include "server/mapping/mapper_factory.hpp"

#include <spdlog/spdlog.h>

#include <exception>
#include <stdexcept>
#include <string>
#include <utility>

#include "config/loaders/model_file.hpp"
#include "core/segmentation/segmenter.hpp"
#include "server/mapping/async_segmenter.hpp"

namespace stillmap::server {
namespace {

// Of the mapper's own poses; stamps that are set back are looked for among them. The whole path is
// the latest map's.
constexpr std::size_t mapper_poses = 1000;

/// Has no labels, and tells why for each scan.
class UnavailableSegmenter final : public Segmenter {
 public:
  explicit UnavailableSegmenter(std::string why) : why_(std::move(why)) {}
  [[nodiscard]] std::string name() const override { return "none"; }
  [[nodiscard]] PointLabels segment(const Scan& /*scan*/) override {
    throw std::runtime_error(why_);
  }

 private:
  std::string why_;
};

}  // namespace

MapperFactory::MapperFactory(const ServerConfig& config, MapperConfig mapper,
                             OpenSegmenter open_segmenter, const ScanQueue& queue,
                             Statistics& statistics)
    : mapper_(std::move(mapper)),
      automatic_(config.automatic_sensor),
      labels_(config.labels),
      open_segmenter_(std::move(open_segmenter)),
      budget_(segmentation_budget(config)),
      queue_(queue),
      statistics_(statistics) {}

Mapper MapperFactory::make(std::unique_ptr<Segmenter> segmenter, MapperListeners listeners) const {
  Mapper made(mapper_, pipeline_of(std::move(segmenter)), std::move(listeners));
  made.limit_trajectory(mapper_poses);
  return made;
}

void MapperFactory::tell_of_better_model(const SensorModel& sensor) const {
  try {
    if (const std::string hint = better_model(labels_, sensor); !hint.empty())
      spdlog::info("{}; labels.model chooses", hint);
  } catch (const ConfigError&) {
    // Whoever opens the model is told.
    return;
  }
}

void MapperFactory::use_sensor(const SensorModel& sensor, const Eigen::Isometry3d& T_base_lidar,
                               Mapper& mapper) const {
  MapperConfig config = mapper_;
  if (const auto fault = range_fault(sensor, automatic_, config.prepare))
    spdlog::warn("prepare.{} {}; until then both ranges are the lidar's", fault->field,
                 fault->text);
  stillmap::use_sensor(sensor, automatic_, config);
  std::unique_ptr<Segmenter> segmenter;
  try {
    segmenter = open_segmenter_(sensor, T_base_lidar);
  } catch (const std::exception& fault) {
    const std::string why = "for the lidar '" + sensor.name + "': " + fault.what();
    const bool may_come_with_scans = labels_.source == LabelProvider::automatic;
    spdlog::error("no labels {}{}", why,
                  may_come_with_scans ? "; those that come with scans are taken" : "");
    segmenter = std::make_unique<UnavailableSegmenter>(why);
    if (may_come_with_scans) segmenter = std::make_unique<FallbackSegmenter>(std::move(segmenter));
  }
  mapper.use_sensor(config, pipeline_of(std::move(segmenter)));
}

std::unique_ptr<SegmentationPipeline> MapperFactory::pipeline_of(
    std::unique_ptr<Segmenter> segmenter) const {
  return std::make_unique<AsyncSegmenter>(std::move(segmenter), budget_, queue_, statistics_);
}

}  // namespace stillmap::server
