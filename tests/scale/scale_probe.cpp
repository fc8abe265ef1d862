// What `make test-scale` measures on a running server, over DDS; prints one line of JSON.
//
//   scale_probe DOMAIN first-pose SCAN 0          drives until a pose comes
//   scale_probe DOMAIN rate SCAN SECONDS          drives as fast as scans are taken
//   scale_probe DOMAIN versions SCAN COUNT        asks for the versions of 1 km2, while driving
//   scale_probe DOMAIN join SCAN WINDOW_M         joins late, and waits for the tiles in the window
//   scale_probe DOMAIN park SCAN 0                drives to the end of a round
//   scale_probe DOMAIN ages SCAN SECONDS          how old poses are when they arrive, parked there
//   scale_probe DOMAIN crowd 0 0 [MAP OTHER]      16 clients at once, until stdin ends: they page
//   and
//                                                 ask for removed voxels and versions; one more
//                                                 loads the two maps in turns, and resets
//   scale_probe DOMAIN hang 0 0                   asks for the whole map without end: to be stopped
//   scale_probe DOMAIN stand SCAN SECONDS         a lidar that stands, with noise
//
// SCAN is the first scan of the drive; "next_scan" in the output is where the next drive goes on.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "clients/library/client.hpp"
#include "clients/library/scan_publisher.hpp"
#include "core/map/query/region.hpp"
#include "tests/scale/scale_drive.hpp"

namespace stillmap::test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using nlohmann::json;

constexpr auto patience = 120s;

double seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

dds::DdsOptions loopback(std::uint32_t domain) {
  dds::DdsOptions options;
  options.domain_id = domain;
  options.interfaces = {"127.0.0.1"};
  return options;
}

ClientOptions client_options(std::uint32_t domain) {
  return {.dds = loopback(domain), .server_name = "stillmap", .request_timeout = 30s};
}

/// When scans were published.
class PublicationTimes {
 public:
  void note(std::int64_t stamp_ns) {
    const std::scoped_lock lock(mutex_);
    times_[stamp_ns] = Clock::now();
  }
  [[nodiscard]] double age_ms(std::int64_t stamp_ns) const {
    const std::scoped_lock lock(mutex_);
    const auto found = times_.find(stamp_ns);
    return found == times_.end() ? NAN : 1e3 * seconds(Clock::now() - found->second);
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::int64_t, Clock::time_point> times_;
};

/// Where the path of a made map ends.
constexpr int last_of_round = scans_a_round - 1;

/// Publishes the drive on a thread, no faster than `period`; a lidar that is parked stands where
/// the paths of all made maps end.
class Drive {
 public:
  Drive(std::uint32_t domain, int first, std::chrono::milliseconds period, bool is_parked = false,
        PublicationTimes* times = nullptr)
      : is_parked_(is_parked),
        times_(times),
        publisher_({.dds = loopback(domain), .lossless = true}),
        next_(first) {
    if (!publisher_.wait_for_subscriber(patience)) throw std::runtime_error("no server");
    thread_ = std::jthread([this, period](const std::stop_token& stop) { run(stop, period); });
  }
  [[nodiscard]] int next() const { return next_; }
  /// The next scan of the drive, when this one has ended.
  [[nodiscard]] int end() {
    thread_ = {};
    return next_;
  }

 private:
  void run(const std::stop_token& stop, std::chrono::milliseconds period) {
    auto due = Clock::now();
    while (!stop.stop_requested()) {
      StampedPose pose = round_pose(next_);
      if (is_parked_) pose.T_map_lidar = round_pose(last_of_round).T_map_lidar;
      const Scan scan = seen_in_room(pose);
      if (times_ != nullptr) times_->note(scan.stamp_ns);
      if (!publisher_.publish(scan, {}, 1s)) continue;
      ++next_;
      due = std::max(due + period, Clock::now() - period);
      std::this_thread::sleep_until(due);
    }
  }

  bool is_parked_;
  PublicationTimes* times_;
  ScanPublisher publisher_;
  std::atomic<int> next_;
  std::jthread thread_;
};

double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values.empty()
             ? NAN
             : values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

json first_pose(std::uint32_t domain, int scan) {
  Client client(client_options(domain));
  std::atomic<double> pose_at = 0.0;
  const auto poses = client.subscribe_odometry([&](const OdometryUpdate&) {
    double none = 0.0;
    pose_at.compare_exchange_strong(none, seconds(Clock::now().time_since_epoch()));
  });
  // Waiting already when the server starts: the caller starts it when it reads this line.
  std::puts("ready");
  std::fflush(stdout);
  Drive drive(domain, scan, 100ms);
  while (pose_at == 0.0) std::this_thread::sleep_for(1ms);
  return {{"pose_at_s", pose_at.load()}, {"next_scan", drive.end()}};
}

json rate(std::uint32_t domain, int scan, std::chrono::seconds duration) {
  Client client(client_options(domain));
  client.wait_for_server(patience);
  const auto mapped = [&] { return client.status().counter("scans_mapped"); };
  Drive drive(domain, scan, 0ms);
  std::this_thread::sleep_for(2s);
  const auto began = Clock::now();
  const std::uint64_t before = mapped();
  std::this_thread::sleep_for(duration);
  const std::uint64_t after = mapped();
  const double took_s = seconds(Clock::now() - began);
  return {{"scans_per_s", static_cast<double>(after - before) / took_s},
          {"next_scan", drive.end()}};
}

json versions(std::uint32_t domain, int scan, int count) {
  Client client(client_options(domain));
  client.wait_for_server(patience);
  Drive drive(domain, scan, 100ms);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> corner_m(-1000.0, 0.0);
  std::vector<double> took_ms;
  std::size_t tiles = 0;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d low(corner_m(random), corner_m(random), -1e3);
    const auto began = Clock::now();
    tiles =
        client.get_tile_versions({low, low + Eigen::Vector3d(1000.0, 1000.0, 2e3)}).tiles.size();
    took_ms.push_back(1e3 * seconds(Clock::now() - began));
  }
  return {{"tiles", tiles},
          {"p50_ms", quantile(took_ms, 0.5)},
          {"p99_ms", quantile(took_ms, 0.99)},
          {"next_scan", drive.end()}};
}

json join(std::uint32_t domain, int scan, double window_m) {
  Drive drive(domain, scan, 100ms);
  std::map<TileId, std::size_t> wanted;
  {
    Client first(client_options(domain));
    first.wait_for_server(patience);
    // A tile within the window's edge: the window follows the robot.
    const double half_m = window_m / 2.0 - 25.0;
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(half_m);
    for (const TileInfo& info : first.get_tile_versions({-half, half}).tiles) {
      wanted[info.id] = info.voxel_count;
    }
  }
  const auto began = Clock::now();
  Client late(client_options(domain));
  std::mutex mutex;
  std::set<TileId> got;
  const auto tiles = late.subscribe_tiles([&](const dds::MapIdentity&, const Tile& tile) {
    const std::scoped_lock lock(mutex);
    if (wanted.contains(tile.info.id)) got.insert(tile.info.id);
  });
  std::size_t have = 0;
  while (have < wanted.size() && Clock::now() - began < patience) {
    std::this_thread::sleep_for(1ms);
    const std::scoped_lock lock(mutex);
    have = got.size();
  }
  return {{"tiles", wanted.size()},
          {"got", have},
          {"took_s", seconds(Clock::now() - began)},
          {"next_scan", drive.end()}};
}

json park(std::uint32_t domain, int scan) {
  Drive drive(domain, scan, 20ms);
  const int last = (scan / scans_a_round + 1) * scans_a_round + last_of_round;
  while (drive.next() < last) std::this_thread::sleep_for(1ms);
  static_cast<void>(drive.end());
  return {{"next_scan", last + 1}};
}

json ages(std::uint32_t domain, int scan, std::chrono::seconds duration) {
  Client client(client_options(domain));
  client.wait_for_server(patience);
  PublicationTimes times;
  std::mutex mutex;
  std::vector<double> ages_ms;
  const auto poses = client.subscribe_odometry([&](const OdometryUpdate& update) {
    const double age_ms = times.age_ms(update.pose.stamp_ns);
    const std::scoped_lock lock(mutex);
    if (std::isfinite(age_ms)) ages_ms.push_back(age_ms);
  });
  const auto take_ages = [&](std::chrono::seconds time) {
    std::this_thread::sleep_for(time);
    const std::scoped_lock lock(mutex);
    return std::exchange(ages_ms, {});
  };
  Drive drive(domain, scan, 100ms, true, &times);
  static_cast<void>(take_ages(1s));
  const std::vector<double> taken_ms = take_ages(duration);
  return {{"poses", taken_ms.size()},
          {"p50_ms", quantile(taken_ms, 0.5)},
          {"p99_ms", quantile(taken_ms, 0.99)},
          {"max_ms", quantile(taken_ms, 1.0)},
          {"next_scan", drive.end()}};
}

BoxRegion square_km() {
  const Eigen::Vector3d half(500.0, 500.0, 1e3);
  return {{-half, half}};
}

/// Clients that each ask for one thing again and again, from a thread of their own.
class Crowd {
 public:
  explicit Crowd(std::uint32_t domain) : domain_(domain) {}

  /// What the server refuses is counted, and the last refusal told.
  void add(int clients, const std::function<void(Client&)>& ask) {
    for (int i = 0; i < clients; ++i) {
      threads_.emplace_back([this, ask](const std::stop_token& stop) {
        Client client(client_options(domain_));
        client.wait_for_server(patience);
        ++ready_;
        while (!stop.stop_requested()) {
          try {
            ask(client);
            ++answers_;
          } catch (const std::runtime_error& refusal) {
            ++refusals_;
            const std::scoped_lock lock(mutex_);
            last_refusal_ = refusal.what();
          }
        }
      });
    }
  }
  void wait_until_ready() const {
    while (ready_ < threads_.size()) std::this_thread::sleep_for(1ms);
  }
  [[nodiscard]] json end() {
    for (std::jthread& thread : threads_) thread.request_stop();
    threads_.clear();
    return {{"answers", answers_.load()},
            {"refusals", refusals_.load()},
            {"last refusal", last_refusal_}};
  }

 private:
  std::uint32_t domain_;
  std::atomic<std::size_t> ready_ = 0;
  std::atomic<int> answers_ = 0;
  std::atomic<int> refusals_ = 0;
  std::mutex mutex_;
  std::string last_refusal_;
  std::vector<std::jthread> threads_;
};

void page(Client& client, double resolution_m) {
  MapQuery query;
  query.region = square_km();
  query.resolution_m = resolution_m;
  query.max_bytes = 500'000;
  static_cast<void>(client.get_whole_static_map(query));
}

/// An operator: the other map, an empty one, and back, with some time in each. What a reset keeps
/// is the other map from then on.
void change_map(Client& client, const std::string& map, std::string& other) {
  static_cast<void>(client.load_map(other));
  std::this_thread::sleep_for(1s);
  other = std::filesystem::path(client.reset().kept_file).filename();
  std::this_thread::sleep_for(1s);
  static_cast<void>(client.load_map(map));
  std::this_thread::sleep_for(3s);
}

json crowd(std::uint32_t domain, const std::string& map, std::string other) {
  Crowd clients(domain);
  clients.add(6, [](Client& client) { page(client, 0.5); });
  clients.add(4, [](Client& client) { page(client, 0.0); });
  clients.add(4, [](Client& client) { static_cast<void>(client.get_removed(square_km())); });
  clients.add(
      2, [](Client& client) { static_cast<void>(client.get_tile_versions(square_km().box_map)); });
  if (!map.empty()) clients.add(1, [&](Client& client) { change_map(client, map, other); });
  clients.wait_until_ready();
  std::puts("ready");
  std::fflush(stdout);
  while (std::getchar() != EOF) {
  }
  json result = clients.end();
  if (map.empty()) return result;
  Client last(client_options(domain));
  last.wait_for_server(patience);
  static_cast<void>(last.load_map(map));
  return result;
}

json hang(std::uint32_t domain) {
  Client client(client_options(domain));
  client.wait_for_server(patience);
  std::puts("ready");
  std::fflush(stdout);
  for (;;) page(client, 0.0);
}

json stand(std::uint32_t domain, int scan, std::chrono::seconds duration) {
  ScanPublisher publisher({.dds = loopback(domain), .lossless = true});
  if (!publisher.wait_for_subscriber(patience)) throw std::runtime_error("no server");
  const StampedPose place = round_pose(scan);
  std::mt19937 random(7);
  std::normal_distribution<float> noise_m(0.0F, 0.02F);
  int sent = 0;
  for (const auto end = Clock::now() + duration; Clock::now() < end; ++sent) {
    Scan seen =
        seen_in_room({place.stamp_ns + std::int64_t{sent} * 100'000'000, place.T_map_lidar});
    for (Eigen::Vector3f& point : seen.points_lidar) point += noise_m(random) * point.normalized();
    static_cast<void>(publisher.publish(seen, {}, 1s));
    std::this_thread::sleep_for(95ms);
  }
  return {{"scans", sent}, {"next_scan", scan + sent}};
}

json run(std::span<const std::string> arguments) {
  const auto number = [&](std::size_t i) {
    return i < arguments.size() ? std::stoi(arguments[i]) : 0;
  };
  const auto domain = static_cast<std::uint32_t>(number(0));
  const std::string& mode = arguments[1];
  const int scan = number(2);
  const std::chrono::seconds duration(number(3));
  if (mode == "first-pose") return first_pose(domain, scan);
  if (mode == "rate") return rate(domain, scan, duration);
  if (mode == "versions") return versions(domain, scan, number(3));
  if (mode == "join") return join(domain, scan, number(3));
  if (mode == "park") return park(domain, scan);
  if (mode == "ages") return ages(domain, scan, duration);
  if (mode == "crowd") {
    const bool changes_maps = arguments.size() > 5;
    return crowd(domain, changes_maps ? arguments[4] : "", changes_maps ? arguments[5] : "");
  }
  if (mode == "hang") return hang(domain);
  if (mode == "stand") return stand(domain, scan, duration);
  throw std::runtime_error("unknown mode " + mode);
}

}  // namespace
}  // namespace stillmap::test

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  if (arguments.size() < 4) {
    std::fprintf(stderr, "usage: %s DOMAIN MODE SCAN NUMBER [MAP OTHER]\n", argv[0]);
    return 2;
  }
  try {
    std::puts(stillmap::test::run(arguments).dump().c_str());
  } catch (const std::exception& fault) {
    std::fprintf(stderr, "scale_probe: %s\n", fault.what());
    return 1;
  }
}
