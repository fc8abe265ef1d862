#include "server/localization/place_finder.hpp"

#include <spdlog/spdlog.h>

#include <exception>
#include <stdexcept>
#include <utility>

#include "server/threads/background_throttle.hpp"

namespace stillmap::server {
namespace {

using Clock = std::chrono::steady_clock;
using Outcome = GlobalLocalization::Outcome;

/// A search of a second's length, at 20 Hz.
constexpr std::size_t max_waiting_scans = 20;
/// Of one search to the next, at most.
constexpr int max_followed_scans = 20;
/// So many searches in a row, and then one a second.
constexpr int eager_searches = 20;
constexpr std::chrono::seconds pause{1};
/// Scans that may deny a guess before it is refused.
constexpr int scans_of_guess = 5;
/// What a robot drives until the scans come that confirm where it was found [m].
constexpr double applied_radius_m = 20.0;
/// A robot that was switched off is mostly found so near [m].
constexpr double expected_radius_m = 24.0;
/// A map that grows is made searchable again after so long, and one that nobody looks in is freed.
constexpr std::chrono::seconds max_age{10};
constexpr std::chrono::seconds max_unused{60};

double milliseconds_since(Clock::time_point began) {
  return std::chrono::duration<double, std::milli>(Clock::now() - began).count();
}

}  // namespace

std::shared_ptr<const Localizer> SearchableMap::localizer() {
  const std::scoped_lock lock(mutex_);
  const auto view = latest_map_.view();
  used_ = Clock::now();
  const std::uint64_t corrections = latest_map_.corrections();
  const bool is_same = view->map_id == map_id_ && view->version == map_version_;
  const bool is_recent =
      view->map_id == map_id_ && corrections == corrections_ && used_ - built_ < max_age;
  if (localizer_ && (is_same || is_recent)) return localizer_;
  localizer_.reset();
  // The reader outlives the index, and whoever uses it.
  const std::shared_ptr<TileReader> tiles(std::shared_ptr<void>(), &tiles_);
  auto index = std::make_shared<const PlaceIndex>(view, latest_map_.trajectory(), tiles);
  if (const std::size_t unread = index->unread_tiles(); unread > 0) {
    throttled_log_.warn("place_search", std::to_string(unread) +
                                            " tiles of the map cannot be read: the robot is not "
                                            "looked for there");
  }
  localizer_ = std::make_shared<const Localizer>(std::move(index));
  map_id_ = view->map_id;
  map_version_ = view->version;
  corrections_ = corrections;
  built_ = Clock::now();
  return localizer_;
}

void SearchableMap::release_unused() {
  const std::scoped_lock lock(mutex_);
  if (localizer_ && Clock::now() - used_ > max_unused) localizer_.reset();
}

void SearchableMap::discard() {
  const std::scoped_lock lock(mutex_);
  localizer_.reset();
}

MapperConfig mapper_config_beside_finder(const ServerConfig& config) {
  MapperConfig mapper = config.mapper;
  if (config.input.delivery == DeliveryMode::every) return mapper;
  mapper.odometry.first_reach_m = 0.0;
  mapper.odometry.relocalization_interval = 100;
  return mapper;
}

PlaceFinder::PlaceFinder(const ServerConfig& config, const LatestMap& latest_map, TileReader& tiles,
                         Statistics& statistics)
    : statistics_(statistics),
      map_(latest_map, tiles),
      mapper_config_(mapper_config_beside_finder(config)),
      scans_(max_waiting_scans) {
  worker_.emplace(
      "place_finder", scans_, [this](const LostScan& lost) { handle(lost); },
      WorkerOptions{
          .on_start = [] { static_cast<void>(use_scheduling(BackgroundScheduling::low)); },
          .on_idle =
              [this] {
                if (search_ == 0) localization_.reset();
                map_.release_unused();
              },
          .idle_period = std::chrono::seconds(1)});
}

void PlaceFinder::use_sensor(const SensorModel& sensor) {
  {
    const std::scoped_lock lock(mutex_);
    mapper_config_.sensor = sensor;
  }
  map_corrected();
}

std::optional<Eigen::Isometry3d> PlaceFinder::relocate(Mapper& mapper, std::int64_t stamp_ns) {
  mapper.hand_out_scans(search_ != 0);
  const std::scoped_lock lock(mutex_);
  if (!found_) return std::nullopt;
  GlobalLocalization::Place place = *std::exchange(found_, std::nullopt);
  watch_.forget();
  const Eigen::Isometry3d T_map_lidar = place.T_map_odom * place.odometry.predict(stamp_ns);
  mapper.relocate(std::move(place.odometry));
  return T_map_lidar;
}

void PlaceFinder::add(const Scan& scan, const PointLabels& labels,
                      const Eigen::Isometry3d& T_base_lidar, const Mapper& mapper) {
  LostScan lost{.search = search_, .scan = {}, .labels = labels, .T_base_lidar = T_base_lidar};
  lost.scan.stamp_ns = scan.stamp_ns;
  lost.scan.points_lidar = scan.points_lidar;
  lost.scan.time_offset_s = scan.time_offset_s;
  lost.scan.ring = scan.ring;
  if (!mapper.is_placed() && !mapper.trajectory().empty())
    lost.T_map_lidar_expected = mapper.trajectory().back().T_map_lidar;
  scans_.push_dropping_oldest(std::move(lost));
}

void PlaceFinder::update(std::int64_t stamp_ns, const OdometryResult& odometry,
                         const Mapper& mapper) {
  const std::scoped_lock lock(mutex_);
  const bool is_due = watch_.is_due(stamp_ns, odometry, mapper.is_placed());
  if (LostWatch::knows_place(odometry) && search_ != 0 && !guess_) end_search();
  // What was found while this scan was in work is for the next one.
  if (search_ == 0 && !found_ && is_due && !map_.is_empty()) begin_search(std::nullopt);
}

void PlaceFinder::begin_search(const std::optional<PlaceGuess>& guess) {
  search_ = ++searches_;
  guess_ = guess;
  found_.reset();
}

void PlaceFinder::end_search() {
  search_ = 0;
  guess_.reset();
  statistics_.set_place_search({});
}

void PlaceFinder::forget() {
  watch_.forget();
  const std::scoped_lock lock(mutex_);
  end_search();
  found_.reset();
}

void PlaceFinder::map_corrected() {
  watch_.forget();
  const std::scoped_lock lock(mutex_);
  std::optional<PlaceGuess> guess = guess_;
  if (found_ && last_.scan) {
    guess = PlaceGuess{.T_map_base = found_->T_map_odom *
                                     found_->odometry.predict(last_.scan->scan.stamp_ns) *
                                     last_.T_base_lidar.inverse(),
                       .radius_m = applied_radius_m};
  }
  if (guess) return begin_search(guess);
  end_search();
}

void PlaceFinder::look_near(const PlaceGuess& guess) {
  const std::scoped_lock lock(mutex_);
  // Who says the same again and again is not to have it looked for from the beginning.
  const bool is_same = guess_ && guess_->T_map_base.isApprox(guess.T_map_base) &&
                       guess_->radius_m == guess.radius_m &&
                       guess_->max_turn_rad == guess.max_turn_rad;
  if (search_ == 0 || !is_same) begin_search(guess);
}

void PlaceFinder::keep_last(std::shared_ptr<const LabelledScan> scan, bool has_own_labels,
                            const Eigen::Isometry3d& T_base_lidar) {
  const std::scoped_lock lock(mutex_);
  last_ = {std::move(scan), has_own_labels, T_base_lidar};
}

LocalizationAnswer PlaceFinder::localize(const LocalizationQuestion& question) {
  const auto began = Clock::now();
  const LastScan last = [&] {
    const std::scoped_lock lock(mutex_);
    return last_;
  }();
  if (!last.scan) throw std::runtime_error("no scan was mapped yet, and none can be looked for");
  const LocalizationQuery query(last.scan->scan,
                                last.has_own_labels ? last.scan->labels : PointLabels{},
                                last.T_base_lidar.linear());
  std::optional<SearchRegion> region;
  if (question.guess) region = question.guess->region(last.T_base_lidar);
  LocalizationResult result;
  try {
    result = map_.localizer()->localize(query, region);
  } catch (const std::exception&) {
    map_.discard();
    throw;
  }
  LocalizationAnswer answer{.outcome = result.status, .stamp_ns = last.scan->scan.stamp_ns};
  if (!result.places.empty()) {
    answer.T_map_base = result.places.front().T_map_lidar * last.T_base_lidar.inverse();
    answer.score = result.places.front().evidence.score();
  }
  if (result.places.size() > 1) answer.runner_up_score = result.places[1].evidence.score();
  if (question.apply && result.status == LocalizationStatus::found) {
    look_near({.T_map_base = answer.T_map_base, .radius_m = applied_radius_m});
    answer.applied = true;
  }
  answer.milliseconds = milliseconds_since(began);
  return answer;
}

void PlaceFinder::handle(const LostScan& lost) {
  if (lost.search != search_) return;
  if (localized_search_ != lost.search || !localization_) {
    const std::scoped_lock lock(mutex_);
    localization_.emplace(mapper_config_.odometry, mapper_config_.sensor);
    localized_search_ = lost.search;
  }
  run_behind_the_mapper([&] {
    localization_->follow(lost.scan, lost.labels);
    // What was driven meanwhile comes first: the newest scan is looked for, and one now and then
    // where following takes as long as the scans are apart.
    ++followed_scans_;
    if ((scans_.waiting() == 0 || followed_scans_ >= max_followed_scans) && is_due())
      look_for(lost);
  });
}

bool PlaceFinder::is_due() {
  const bool is_eager = failed_searches_ == 0 && localization_->scans_tried() < eager_searches;
  return is_eager || Clock::now() - searched_ >= pause;
}

GlobalLocalization::Regions PlaceFinder::regions(const LostScan& lost) const {
  GlobalLocalization::Regions regions;
  if (lost.T_map_lidar_expected) {
    regions.expected =
        SearchRegion{.centre_map = lost.T_map_lidar_expected->translation().head<2>(),
                     .radius_m = expected_radius_m};
  }
  const std::scoped_lock lock(mutex_);
  if (!guess_) return regions;
  regions.searched = guess_->region(lost.T_base_lidar);
  return regions;
}

void PlaceFinder::look_for(const LostScan& lost) {
  followed_scans_ = 0;
  try {
    const auto began = Clock::now();
    const Outcome outcome =
        localization_->search(*map_.localizer(), lost.T_base_lidar.linear(), regions(lost));
    searched_ = Clock::now();
    failed_searches_ = 0;
    statistics_.add_latency("place_search", milliseconds_since(began));
    report(outcome, lost);
  } catch (const std::exception& fault) {
    // Tiles that changed or cannot be read: the map is made searchable anew.
    map_.discard();
    searched_ = Clock::now();
    ++failed_searches_;
    const std::string text = std::string("the map cannot be searched: ") + fault.what();
    throttled_log_.warn("place_search", text);
    bool is_guess = false;
    {
      const std::scoped_lock lock(mutex_);
      if (lost.search != search_) return;
      is_guess = guess_.has_value();
      statistics_.set_place_search(text);
    }
    if (is_guess && failed_searches_ >= scans_of_guess) give_up_guess(lost.search, text);
  }
}

void PlaceFinder::report(Outcome outcome, const LostScan& lost) {
  statistics_.count("places_tried");
  if (outcome == Outcome::confirmed) return take_place(lost);
  if (outcome == Outcome::ambiguous) statistics_.count("places_ambiguous");
  if (outcome == Outcome::refused) statistics_.count("places_refused");
  const LocalizationConfig limits;
  const std::string text = fmt::format(
      "{} scans tried, best score {:.2f} (at least {:.2f} needed), next best place {:.2f}, {}",
      localization_->scans_tried(), localization_->best_score(), LocalizationConfig{}.min_score,
      localization_->runner_up_score(), name(outcome));
  spdlog::debug("place search: {}", text);
  bool is_guess = false;
  {
    const std::scoped_lock lock(mutex_);
    if (lost.search != search_) return;
    is_guess = guess_.has_value();
    statistics_.set_place_search(std::string(is_guess
                                                 ? "looking near the pose that it was given: "
                                                 : "looking for its place in the whole map: ") +
                                 text);
  }
  const bool is_open = outcome == Outcome::found || outcome == Outcome::confirming;
  if (is_guess && !is_open && localization_->scans_tried() >= scans_of_guess)
    return give_up_guess(lost.search, text);
  if (!is_guess) throttled_log_.warn("lost", "looking for its place in the map: " + text);
}

void PlaceFinder::take_place(const LostScan& lost) {
  const int tried = localization_->scans_tried();
  GlobalLocalization::Place place = localization_->take_place();
  localization_.reset();
  const std::scoped_lock lock(mutex_);
  if (lost.search != search_) return;
  const Eigen::Vector3d p =
      (place.T_map_odom * place.odometry.predict(lost.scan.stamp_ns)).translation();
  spdlog::info("found its place in the map after {} scans: the lidar is at {:.2f} {:.2f} {:.2f}",
               tried, p.x(), p.y(), p.z());
  statistics_.count("places_found");
  end_search();
  found_ = std::move(place);
}

void PlaceFinder::give_up_guess(std::uint64_t search, const std::string& why) {
  const std::scoped_lock lock(mutex_);
  if (search != search_) return;
  spdlog::warn("the pose that it was given is refused, scans do not fit near it: {}", why);
  statistics_.count("initial_poses_refused");
  end_search();
}

}  // namespace stillmap::server
