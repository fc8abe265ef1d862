#include "server/mapping/scan_receiver.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <sstream>
#include <string_view>
#include <utility>

#include "core/lidar/prepare.hpp"
#include "core/lidar/sensor_fit.hpp"
#include "idl/conversions/header.hpp"
#include "idl/interface/topics.hpp"
#include "server/monitoring/shown_name.hpp"

namespace stillmap::server {
namespace {

// With delivery `every`, a lidar may be so far ahead of another one,
constexpr std::size_t max_ahead = 3;
// and a sweep waits at least so long for a scan: no time of the sensor's passes between scans.
constexpr double min_lossless_wait_s = 5.0;

// Of lidars of different rates: a scan of the slowest comes so much later than one of the fastest
// that began with it.
double difference_of_periods_s(const ServerConfig& config) {
  const auto period_s = [](const LidarConfig& lidar) { return lidar.sensor.period_s; };
  const auto [fastest, slowest] = std::ranges::minmax_element(config.lidars, {}, period_s);
  return fastest == config.lidars.end() ? 0.0 : period_s(*slowest) - period_s(*fastest);
}

SweepMerger::Config merging_of(const ServerConfig& config) {
  const double wait_s = config.input.sweep_wait_s + difference_of_periods_s(config);
  const bool every = config.input.delivery == DeliveryMode::every;
  return {.lidars = config.lidars.size(),
          .period_s = config.mapper.sensor.period_s,
          .max_wait_s = every ? std::max(wait_s, min_lossless_wait_s) : wait_s,
          .partial_labels = config.labels.source == LabelProvider::automatic ? PartialLabels::drop
                                                                             : PartialLabels::keep};
}

// What is too near or too far for each lidar itself.
std::vector<PrepareConfig> ranges_of(const ServerConfig& config) {
  const PrepareConfig& prepare = config.mapper.prepare;
  const AutomaticSensor& left_open = config.automatic_sensor;
  std::vector<PrepareConfig> ranges;
  for (const LidarConfig& lidar : config.lidars) {
    const SensorModel& sensor = lidar.sensor;
    ranges.push_back(
        {.min_range_m = left_open.sets_min_range ? sensor.min_range_m : prepare.min_range_m,
         .max_range_m = left_open.sets_max_range ? sensor.max_range_m : prepare.max_range_m,
         .ego_hull_lidar = {},
         .deskew = false});
  }
  return ranges;
}

std::vector<Eigen::Isometry3d> places_of(const ServerConfig& config) {
  const Eigen::Isometry3d T_merged_base = config.mount.T_base_lidar.inverse();
  std::vector<Eigen::Isometry3d> places;
  places.reserve(config.lidars.size());
  for (const LidarConfig& lidar : config.lidars) {
    places.emplace_back(T_merged_base * lidar.T_base_lidar);
  }
  return places;
}

// A reliable KEEP_ALL reader of fewer samples stalls while it assembles fragments.
constexpr int min_samples = 4;
// The sensor does not change from scan to scan.
constexpr std::uint64_t scans_between_checks = 100;

dds::TopicSpec<sensor_msgs::msg::PointCloud2> points_of(const ServerConfig& config,
                                                        const std::string& ros_topic) {
  const int waiting = std::max(static_cast<int>(config.input.queue_length), min_samples);
  return dds::points_topic(ros_topic, config.input.delivery, waiting);
}

wire::CloudReadOptions reading_of(const ServerConfig& config, const SensorModel& sensor,
                                  PointFieldNames fields) {
  // A field that nobody reads cannot be wrong.
  const bool reads_labels = config.labels.source == LabelProvider::automatic ||
                            config.labels.source == LabelProvider::stream;
  if (!reads_labels) fields.label.clear();
  return {.fields = std::move(fields),
          .intensity_scale = sensor.intensity_scale,
          .labels_are_classes = config.input.label_kind == LabelKind::classes};
}

// By this machine's clock; 0 for a stamp that is not a time.
double seconds_since(const builtin_interfaces::msg::Time& stamp) {
  const auto now = std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch());
  const std::int64_t stamp_ns = wire::stamp_ns(stamp).value_or(now.count());
  return 1e-9 * static_cast<double>(now.count() - stamp_ns);
}

}  // namespace

SweepInput::SweepInput(const ServerConfig& config, ScanQueue& queue, Statistics& statistics)
    : lidars_(config.lidars),
      usable_(ranges_of(config)),
      T_merged_lidars_(places_of(config)),
      frame_(config.frames.lidar),
      delivery_(config.input.delivery),
      queue_(queue),
      statistics_(statistics),
      merger_(merging_of(config)) {}

double SweepInput::now_s() const {
  return std::chrono::duration<double>(Clock::now() - began_).count();
}

void SweepInput::add(std::size_t lidar, Scan scan, const std::stop_token& stop) {
  scan = drop_unusable_points(std::move(scan), usable_[lidar]);
  turn_up(scan, lidars_[lidar].sensor.elevation_offset);
  move_points(scan, T_merged_lidars_[lidar]);
  std::unique_lock lock(mutex_);
  const std::size_t lost = merger_.add(lidar, std::move(scan), now_s());
  if (lost > 0) {
    drop("out_of_sweep", lost,
         "scans of lidar '" + lidars_[lidar].name +
             "' come after their sweep, or their clock differs from that of the others");
  }
  queue_sweeps(stop);
  sweeps_changed_.notify_all();
  while (delivery_ == DeliveryMode::every && merger_.waiting(lidar) > max_ahead &&
         !stop.stop_requested()) {
    sweeps_changed_.wait_for(lock, stop, std::chrono::milliseconds(100),
                             [&] { return merger_.waiting(lidar) <= max_ahead; });
    queue_sweeps(stop);
  }
}

void SweepInput::queue_overdue(const std::stop_token& stop) {
  const std::scoped_lock lock(mutex_);
  queue_sweeps(stop);
}

void SweepInput::queue_sweeps(const std::stop_token& stop) {
  while (auto sweep = merger_.next(now_s())) queue(*std::move(sweep), stop);
}

void SweepInput::queue(SweepMerger::Sweep sweep, const std::stop_token& stop) {
  for (const std::size_t lidar : sweep.missing) {
    const std::string& name = lidars_[lidar].name;
    statistics_.sweep_without(name);
    throttled_log_.warn("lidar_" + name, "no scan of lidar '" + name + "' on " +
                                             lidars_[lidar].topic +
                                             " in time: the sweep goes on without it");
  }
  if (sweep.is_partly_labelled) {
    statistics_.count("sweeps_partly_labelled");
    throttled_log_.warn("partly_labelled",
                        "some lidars send labels and others do not: with labels.source 'auto' the "
                        "network labels all points, with 'stream' those of the others have none");
  }
  statistics_.scan_received();
  QueuedScan queued{std::move(sweep.scan), frame_, Clock::now()};
  if (delivery_ == DeliveryMode::every) {
    if (!queue_.push_blocking(std::move(queued), stop)) {
      drop("shutdown", 1, "the server is stopping");
    }
    return;
  }
  const std::size_t dropped = queue_.push_dropping_oldest(std::move(queued));
  if (dropped > 0) drop("queue_full", dropped, "scans arrive faster than they can be mapped");
}

void SweepInput::drop(const std::string& reason, std::size_t count, const std::string& detail) {
  statistics_.scans_dropped(reason, count, detail);
  throttled_log_.warn(reason, "scan dropped: " + detail);
}

ScanReceiver::ScanReceiver(dds::Participant& participant, const ServerConfig& config,
                           ScanQueue& queue, Statistics& statistics)
    : ScanReceiver(
          participant, config, config.topics.points,
          {{.index = 0,
            .name = "",
            .frame = "",
            .sensor = config.mapper.sensor,
            .reader =
                wire::CloudReader(reading_of(config, config.mapper.sensor, config.input.fields)),
            .recognition = config.automatic_sensor.is_on ? std::make_optional<SensorRecognition>()
                                                         : std::nullopt,
            .turns = TurnJoiner(config.input.clouds_per_turn)}},
          nullptr, queue, statistics) {}

ScanReceiver::ScanReceiver(dds::Participant& participant, const ServerConfig& config,
                           const std::string& ros_topic, SweepInput& sweeps, ScanQueue& queue,
                           Statistics& statistics)
    : ScanReceiver(participant, config, ros_topic, lidars_on(config, ros_topic), &sweeps, queue,
                   statistics) {}

ScanReceiver::ScanReceiver(dds::Participant& participant, const ServerConfig& config,
                           const std::string& ros_topic, std::vector<Lidar> lidars,
                           SweepInput* sweeps, ScanQueue& queue, Statistics& statistics)
    : topic_(points_of(config, ros_topic).dds_name),
      participant_(participant),
      delivery_(config.input.delivery),
      clouds_per_turn_(config.input.clouds_per_turn),
      lidars_(std::move(lidars)),
      sweeps_(sweeps),
      queue_(queue),
      statistics_(statistics),
      doubts_(topic_, !config.frames.base.empty() || !config.lidars.empty()),
      reader_(participant, topic_, points_of(config, ros_topic).reader),
      worker_("scans", std::chrono::seconds(0),
              [this, cloud = sensor_msgs::msg::PointCloud2()](const std::stop_token& stop) mutable {
                eprosima::fastdds::dds::SampleInfo info;
                const bool came = reader_.take(cloud, info, stop, std::chrono::seconds(1));
                drop_unreadable();
                if (came) {
                  count_losses(info.sample_identity);
                  accept(cloud, stop);
                  return;
                }
                end_overdue_turns(stop);
                if (sweeps_ != nullptr) sweeps_->queue_overdue(stop);
              }) {}

std::vector<ScanReceiver::Lidar> ScanReceiver::lidars_on(const ServerConfig& config,
                                                         const std::string& ros_topic) {
  std::vector<Lidar> lidars;
  for (std::size_t i = 0; i < config.lidars.size(); ++i) {
    const LidarConfig& lidar = config.lidars[i];
    if (lidar.topic != ros_topic) continue;
    lidars.push_back({.index = i,
                      .name = lidar.name,
                      .frame = lidar.frame,
                      .sensor = lidar.sensor,
                      .reader = wire::CloudReader(reading_of(config, lidar.sensor, lidar.fields)),
                      .turns = TurnJoiner(config.input.clouds_per_turn)});
  }
  return lidars;
}

ScanReceiver::Lidar* ScanReceiver::lidar_of(const std::string& frame) {
  // Drivers of old have a '/' there, which the configuration leaves away.
  const std::string_view name = std::string_view(frame).substr(frame.starts_with('/') ? 1 : 0);
  const auto found = std::ranges::find_if(
      lidars_, [&](const Lidar& lidar) { return lidar.frame.empty() || lidar.frame == name; });
  return found == lidars_.end() ? nullptr : &*found;
}

void ScanReceiver::count_losses(const eprosima::fastrtps::rtps::SampleIdentity& scan) {
  std::ostringstream writer;
  writer << scan.writer_guid();
  const std::uint64_t lost = losses_.add(scan);
  recent_losses_.add(writer.str(), lost, ScanLossWindow::Clock::now());
  turns_.add(writer.str(), PublisherTurns::Clock::now());
  if (lost == 0) return;
  statistics_.scans_lost(lost);
  throttled_log_.warn("lost", std::to_string(lost) + " scans on " + topic_ +
                                  " got lost on the way: 'stillmap doctor' says why");
}

std::vector<dds::Diagnostic> ScanReceiver::diagnostics() const {
  std::vector<dds::Diagnostic> diagnostics = doubts_.diagnostics();
  const auto losses = recent_losses_.losses(ScanLossWindow::Clock::now());
  // Of several lidars, each may have a publisher.
  const auto in_turns = lidars_.size() > 1 ? std::vector<std::string>()
                                           : turns_.publishers(PublisherTurns::Clock::now());
  if (losses.empty() && in_turns.empty()) return diagnostics;
  const dds::RemoteParticipant self = participant_.self();
  const std::vector<dds::RemoteParticipant> peers = participant_.remote_participants();
  for (const dds::ScanLosses& of_writer : losses) {
    diagnostics.push_back(dds::lost_scans_diagnostic(topic_, of_writer, self, peers));
  }
  if (!in_turns.empty())
    diagnostics.push_back(dds::several_publishers_diagnostic(topic_, in_turns, peers));
  return diagnostics;
}

void ScanReceiver::drop_unreadable() {
  for (const dds::UnreadableSample& sample : reader_.take_unreadable()) {
    has_received_ = true;
    count_losses(sample.identity);
    if (sweeps_ == nullptr) statistics_.scan_received();
    statistics_.bad_cloud(dds::unreadable_cloud);
    drop("bad_cloud", 1, "bad cloud: it has " + sample.why);
  }
}

void ScanReceiver::accept(const sensor_msgs::msg::PointCloud2& cloud, const std::stop_token& stop) {
  has_received_ = true;
  const std::string& frame = cloud.header().frame_id();
  statistics_.record_scan_header(frame, seconds_since(cloud.header().stamp()));
  Lidar* const lidar = lidar_of(frame);
  if (lidar == nullptr) {
    return drop("unknown_frame", 1,
                "a cloud on " + topic_ + " has the frame '" + shown_name(frame) +
                    "', which no lidar of 'sensors' on this topic has");
  }
  auto [from_cloud, cloud_changes] = lidar->reader.read(cloud);
  auto& scan = from_cloud.scan;
  if (!scan) {
    if (sweeps_ == nullptr) statistics_.scan_received();
    statistics_.bad_cloud(from_cloud.fault.counter);
    return drop("bad_cloud", 1, "bad cloud: " + from_cloud.fault.reason);
  }
  report_labels(*lidar, from_cloud.label_census);
  report_layout(*lidar, cloud_changes);
  take(*lidar, *std::move(scan), frame, stop);
}

void ScanReceiver::take(Lidar& lidar, Scan cloud, const std::string& frame,
                        const std::stop_token& stop) {
  if (lidar.frame_read != frame) {
    // Of another lidar, or of one that was moved: no parts of the same turn.
    end_turn(lidar, stop);
    lidar.turns = TurnJoiner(clouds_per_turn_);
    lidar.frame_read = frame;
  }
  const Clock::time_point now_at = Clock::now();
  if (lidar.last_cloud) lidar.between_clouds = now_at - *lidar.last_cloud;
  lidar.last_cloud = now_at;
  const std::size_t before = lidar.turns.clouds_per_turn();
  std::vector<Scan> scans = lidar.turns.add(std::move(cloud));
  const std::size_t now = lidar.turns.clouds_per_turn();
  if (now != before && now > 1)
    spdlog::info("clouds on {} are parts of turns: {} of them are a scan ({})", topic_, now,
                 "input.clouds_per_turn: 1 leaves each a scan");
  pass_on(lidar, std::move(scans), stop);
}

void ScanReceiver::end_overdue_turns(const std::stop_token& stop) {
  // A simulator may take seconds for what it stamps as a tenth of one.
  constexpr Clock::duration least = std::chrono::seconds(1);
  constexpr Clock::duration most = std::chrono::seconds(10);
  const Clock::time_point now = Clock::now();
  for (Lidar& lidar : lidars_)
    if (lidar.last_cloud &&
        now - *lidar.last_cloud >= std::clamp(2 * lidar.between_clouds, least, most))
      end_turn(lidar, stop);
}

void ScanReceiver::end_turn(Lidar& lidar, const std::stop_token& stop) {
  pass_on(lidar, lidar.turns.flush(), stop);
}

void ScanReceiver::pass_on(Lidar& lidar, std::vector<Scan> scans, const std::stop_token& stop) {
  const auto received = std::chrono::steady_clock::now();
  for (Scan& scan : scans) {
    report(lidar, scan);
    doubts_.add(lidar.name, scan);
    report_frame(lidar);
    if (sweeps_ != nullptr) {
      sweeps_->add(lidar.index, std::move(scan), stop);
      continue;
    }
    statistics_.scan_received();
    queue_scan({std::move(scan), lidar.frame_read, received,
                lidar.recognition ? lidar.recognition->sensor() : nullptr},
               stop);
  }
}

void ScanReceiver::queue_scan(QueuedScan queued, const std::stop_token& stop) {
  if (delivery_ == DeliveryMode::every) {
    if (!queue_.push_blocking(std::move(queued), stop)) {
      drop("shutdown", 1, "the server is stopping");
    }
    return;
  }
  const std::size_t dropped = queue_.push_dropping_oldest(std::move(queued));
  if (dropped > 0) {
    drop("queue_full", dropped, "scans arrive faster than they can be mapped");
  }
}

void ScanReceiver::report_labels(const Lidar& lidar, const LabelCensus& census) {
  if (census.unknown() > 0) statistics_.count("unknown_labels", census.unknown());
  const std::string doubt = census.doubt();
  if (doubt.empty()) return;
  const bool are_classes = census.look_like_classes();
  const std::string counter = are_classes ? "labels_look_like_classes" : "labels_mostly_unknown";
  statistics_.count(counter);
  // A line for each lidar: every scan says the same.
  if (!layouts_.add(lidar.name + counter)) return;
  spdlog::warn(
      "labels on {} are read as SemanticKITTI ids and {}: set {}'labels.source: model' to do "
      "without them; counted as {}",
      topic_, doubt,
      are_classes ? "'input.label_kind: classes' where 1 is car and 9 road, or " : "", counter);
}

void ScanReceiver::report_layout(Lidar& lidar, const std::string& cloud_changes) {
  // Of two publishers in turn, say, every cloud is another than the last.
  if (cloud_changes.empty() || !layouts_.add(lidar.name + cloud_changes)) return;
  lidar.is_layout_new = true;
  spdlog::info("clouds on {}: {}", topic_, cloud_changes);
}

void ScanReceiver::report(Lidar& lidar, const Scan& scan) {
  const bool is_new = std::exchange(lidar.is_layout_new, false);
  const bool due = lidar.scans_read++ % scans_between_checks == 0;
  const bool is_unknown = lidar.recognition && !lidar.recognition->sensor();
  if (!due && !is_new && !is_unknown) return;
  if (lidar.recognition) recognise(lidar, scan);
  // A lidar that is not known yet is taken for no other one.
  if (lidar.recognition && !lidar.recognition->sensor()) return;
  const std::string misfit = sensor_mismatch(scan, lidar.sensor);
  if (misfit.empty()) return;
  statistics_.count("sensor_mismatch");
  throttled_log_.warn("sensor",
                      misfit +
                          ": set 'sensor' in the configuration ('stillmap dataset sensor' "
                          "makes a sensor file from a recording)");
}

void ScanReceiver::report_frame(const Lidar& lidar) {
  const bool is_told = lidar.recognition && lidar.recognition->sensor();
  if (!is_told || lidar.frame_read == lidar.frame_told) return;
  statistics_.count("clouds_of_another_frame");
  throttled_log_.warn("frame", "clouds on " + topic_ + " are of the frame '" +
                                   shown_name(lidar.frame_read) + "', and those of '" +
                                   shown_name(lidar.frame_told) +
                                   "' told which lidar it is: they are taken for that one's; where "
                                   "it is another, start the server again, or name it (sensor)");
}

void ScanReceiver::recognise(Lidar& lidar, const Scan& scan) {
  if (lidar.recognition->sensor() && lidar.frame_read != lidar.frame_told) return;
  if (!lidar.recognition->learn(scan)) return;
  lidar.frame_told = lidar.frame_read;
  lidar.sensor = *lidar.recognition->sensor();
  spdlog::info("the lidar, as its scans tell: {}", in_words(lidar.sensor));
}

void ScanReceiver::drop(const std::string& reason, std::size_t count, const std::string& detail) {
  statistics_.scans_dropped(reason, count, detail);
  throttled_log_.warn(reason, "scan dropped: " + detail);
}

std::string ScanReceiver::no_input_reason() const {
  if (has_received_) return {};
  std::string text =
      "no scan received on " + topic_ + " yet: " + std::to_string(reader_.matched_writers()) +
      " publishers matched in domain " + std::to_string(participant_.options().domain_id);
  if (reader_.incompatible_writers() > 0) {
    text += "; " + std::to_string(reader_.incompatible_writers()) +
            " publishers do not fit, as they are best-effort and delivery is 'every'";
  }
  return text;
}

}  // namespace stillmap::server
