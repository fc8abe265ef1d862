// Planners for network tests: each takes all tiles and all poses, and in the end compares what it
// has with what the server says that there is. Prints a JSON line, with the server's own figures.
#include <algorithm>
#include <chrono>
#include <deque>
#include <iostream>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/library/client.hpp"

namespace stillmap {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

struct Arguments {
  cli::ClientArguments client;
  int count = 1;
  /// Longest time, from the end of the drive, until all tiles must have come.
  double settle_s = 30.0;
  /// A client that takes so long for each sample.
  double busy_ms = 0.0;
  bool with_poses = true;
};

/// When poses came, and how old they were then.
class PoseAges {
 public:
  void note(std::int64_t stamp_ns) {
    const auto now_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                            std::chrono::system_clock::now().time_since_epoch())
                            .count();
    const auto now = Clock::now();
    const std::scoped_lock lock(mutex_);
    ages_ms_.push_back(static_cast<double>(now_ns - stamp_ns) / 1e6);
    if (last_) max_gap_s_ = std::max(max_gap_s_, Seconds(now - *last_).count());
    last_ = now;
  }

  [[nodiscard]] nlohmann::json report() const {
    const std::scoped_lock lock(mutex_);
    if (ages_ms_.empty()) return {{"count", 0}};
    std::vector<double> sorted(ages_ms_);
    std::ranges::sort(sorted);
    return {{"count", sorted.size()},
            {"p50_ms", sorted[sorted.size() / 2]},
            {"p99_ms", sorted[sorted.size() * 99 / 100]},
            {"max_ms", sorted.back()},
            {"last_ms", ages_ms_.back()},
            {"max_gap_s", max_gap_s_}};
  }

 private:
  mutable std::mutex mutex_;
  std::vector<double> ages_ms_;
  std::optional<Clock::time_point> last_;
  double max_gap_s_ = 0.0;
};

class Planner {
 public:
  Planner(const Arguments& arguments, const ClientOptions& options)
      : client_(options),
        busy_(arguments.busy_ms),
        tiles_subscription_(client_.subscribe_tiles(
            [this](const dds::MapIdentity&, const Tile& tile) { note(tile.info); })) {
    if (!arguments.with_poses) return;
    poses_subscription_.emplace(client_.subscribe_odometry([this](const OdometryUpdate& update) {
      poses_.note(update.pose.stamp_ns);
      std::this_thread::sleep_for(busy_);
    }));
  }

  [[nodiscard]] Client& client() { return client_; }
  [[nodiscard]] const PoseAges& poses() const { return poses_; }

  /// Tiles of the server that this client does not have, or not as new.
  [[nodiscard]] std::size_t lacks(const TileVersions& versions) const {
    const std::scoped_lock lock(mutex_);
    return static_cast<std::size_t>(std::ranges::count_if(versions.tiles, [&](const auto& tile) {
      const auto found = revisions_.find(tile.id);
      return found == revisions_.end() || found->second < tile.revision;
    }));
  }

 private:
  void note(const TileInfo& info) {
    {
      const std::scoped_lock lock(mutex_);
      revisions_[info.id] = std::max(revisions_[info.id], info.revision);
    }
    std::this_thread::sleep_for(busy_);
  }

  Client client_;
  std::chrono::duration<double, std::milli> busy_;
  mutable std::mutex mutex_;
  std::map<TileId, std::uint64_t> revisions_;
  PoseAges poses_;
  // Last: they end before what they fill.
  Subscription tiles_subscription_;
  std::optional<Subscription> poses_subscription_;
};

using Planners = std::deque<Planner>;

std::optional<TileVersions> versions_of(Client& client) {
  try {
    return client.get_tile_versions();
  } catch (const ServiceTimeout&) {
    return std::nullopt;  // The network is down for a while.
  }
}

std::size_t lacking(const Planners& planners, const TileVersions& versions) {
  std::size_t most = 0;
  for (const Planner& planner : planners) most = std::max(most, planner.lacks(versions));
  return most;
}

struct Settled {
  std::size_t tiles = 0;
  std::size_t lacking = 0;
  double took_s = 0.0;
};

/// Waits until the map stands still and all planners have all of it.
Settled settle(Planners& planners, double max_s) {
  const auto began = Clock::now();
  Settled settled;
  do {
    const auto versions = versions_of(planners.front().client());
    settled.took_s = Seconds(Clock::now() - began).count();
    if (versions) {
      settled.tiles = versions->tiles.size();
      settled.lacking = lacking(planners, *versions);
      if (settled.tiles > 0 && settled.lacking == 0) break;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  } while (settled.took_s < max_s);
  return settled;
}

/// What the server says of its work.
nlohmann::json mapper_report(const dds::ServerStatus& status) {
  nlohmann::json report{{"mapped", status.counter("scans_mapped")}};
  for (const dds::StageLatency& stage : status.latencies) {
    if (stage.stage != "total") continue;
    report["p50_ms"] = stage.p50_ms;
    report["p99_ms"] = stage.p99_ms;
  }
  return report;
}

/// It ends when the drive does.
void wait_for_end_of_input() {
  std::string line;
  while (std::getline(std::cin, line)) {
  }
}

cli::ExitCode watch(const Arguments& arguments) {
  Planners planners;
  for (int i = 0; i < arguments.count; ++i) {
    planners.emplace_back(arguments, arguments.client.client());
  }
  planners.front().client().wait_for_server(arguments.client.timeout());
  std::cerr << "ready" << std::endl;
  wait_for_end_of_input();
  const auto poses = planners.front().poses().report();
  const Settled settled = settle(planners, arguments.settle_s);
  std::cout << nlohmann::json{{"tiles", settled.tiles},
                              {"lacking", settled.lacking},
                              {"settled_s", settled.took_s},
                              {"mapper", mapper_report(planners.front().client().status())},
                              {"poses", poses}}
            << std::endl;
  return settled.tiles > 0 && settled.lacking == 0 ? cli::ExitCode::ok : cli::ExitCode::failed;
}

}  // namespace
}  // namespace stillmap

int main(int argc, char** argv) {
  stillmap::cli::CommandLine line("lab_clients", "", "Planners for network tests.");
  stillmap::Arguments arguments;
  auto root = line.root();
  root.option("--count", arguments.count, "Planners");
  root.option("--settle", arguments.settle_s, "Wait so long for all tiles in the end [s]");
  root.option("--busy-ms", arguments.busy_ms, "Take so long for each sample");
  root.flag("--poses,!--no-poses", arguments.with_poses, "Take poses, too (default)");
  stillmap::cli::add_client_options(root, arguments.client);
  return stillmap::cli::run_program(line, argc, argv, [&] { return stillmap::watch(arguments); });
}
