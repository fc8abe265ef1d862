#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "clients/library/connection.hpp"
#include "clients/library/region_tracker.hpp"
#include "core/map/tile_lookup.hpp"
#include "idl/conversions/tile.hpp"
#include "idl/dds/reader.hpp"

namespace stillmap {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// A view that is published sends its changed tiles one after the other: they become one request.
constexpr auto gather_pause = 20ms;
constexpr auto longest_gather = 200ms;

/// Which entries of the tile index a region may be interested in.
ContentFilter filter_for(const Region& region, double tile_size_m) {
  const TileRange range = tile_range(RegionShape(region).bounds_map(), tile_size_m);
  return {.expression = "tile_x BETWEEN %0 AND %1 AND tile_y BETWEEN %2 AND %3",
          .parameters = {std::to_string(range.first.x), std::to_string(range.last.x),
                         std::to_string(range.first.y), std::to_string(range.last.y)}};
}

/// The reader of a region's part of the index, and the thread that turns entries into news.
class RegionReceiver final : public Subscription::Receiver {
 public:
  using FetchTiles = std::function<TileSet(std::span<const TileId>)>;

  RegionReceiver(Participant& participant, const TopicSpec<stillmap_msgs::msg::TileInfo>& index,
                 const Region& region, double tile_size_m, FetchTiles fetch,
                 std::function<void(const RegionNews&)> news_arrived)
      : watch_(region, tile_size_m),
        fetch_(std::move(fetch)),
        news_arrived_(std::move(news_arrived)),
        reader_(participant, index.dds_name, index.reader, filter_for(region, tile_size_m)),
        thread_([this](const std::stop_token& stop) { receive(stop); }) {}

 private:
  void receive(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      gather(stop);
      if (watch_.has_news() && !stop.stop_requested()) tell();
    }
  }

  /// Waits for an entry, and for those that follow it closely.
  void gather(const std::stop_token& stop) {
    auto pause = std::chrono::milliseconds(1s);
    std::optional<Clock::time_point> first;
    while (reader_.take(sample_, stop, pause)) {
      if (const auto info = wire::from_wire(sample_)) {
        watch_.note(wire::from_wire(sample_.identity()), *info);
      }
      if (!first) first = Clock::now();
      if (Clock::now() - *first > longest_gather) return;
      pause = gather_pause;
    }
  }

  void tell() {
    auto tiles = fetch_wanted();
    if (!tiles) return;
    const RegionNews news = watch_.take_news(*std::move(tiles));
    if (!news.appeared.empty() || !news.changed.empty() || !news.removed.empty()) {
      news_arrived_(news);
    }
  }

  std::optional<TileSet> fetch_wanted() {
    try {
      return fetch_(watch_.wanted());
    } catch (const ServiceError&) {
      // The server is gone or busy. What is wanted stays wanted, and is asked for again.
      return std::nullopt;
    }
  }

  RegionWatch watch_;
  FetchTiles fetch_;
  std::function<void(const RegionNews&)> news_arrived_;
  stillmap_msgs::msg::TileInfo sample_;
  Reader<stillmap_msgs::msg::TileInfo> reader_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace

Subscription Client::subscribe_region(const Region& region,
                                      std::function<void(const RegionNews&)> news_arrived) {
  const RegionShape shape(region);
  const double tile_size_m = get_tile_versions(shape.bounds_map()).map.tile_size_m;
  Connection& connection = *connection_;
  return Subscription(std::make_unique<RegionReceiver>(
      connection.participant, connection.topics.tile_index, region, tile_size_m,
      [&connection](std::span<const TileId> ids) { return connection.fetch_tiles(ids); },
      std::move(news_arrived)));
}

}  // namespace stillmap
