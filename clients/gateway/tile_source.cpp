#include "clients/gateway/tile_source.hpp"

#include <algorithm>
#include <condition_variable>
#include <iterator>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <thread>
#include <utility>

#include "clients/gateway/tile_format.hpp"
#include "idl/conversions/tile.hpp"
#include "idl/dds/service_client.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::gateway {
namespace {

using stillmap_msgs::srv::GetTiles_Request;
using stillmap_msgs::srv::GetTiles_Response;

constexpr std::size_t max_kept_bytes = 128U << 20U;
/// In one request: an answer ends at a few megabytes anyhow.
constexpr std::size_t max_tiles_per_request = 64;
constexpr std::uint8_t reply_ok = 0;

GetTiles_Request request_for(const std::vector<TileId>& ids) {
  GetTiles_Request request;
  request.format_version(dds::wire_format_version);
  for (const TileId id : ids) {
    stillmap_msgs::msg::TileId wire_id;
    wire_id.x(id.x);
    wire_id.y(id.y);
    request.ids().push_back(wire_id);
  }
  return request;
}

}  // namespace

/// Asks the server, in a thread of its own.
class TileSource::Fetcher {
 public:
  using Arrived = std::function<void(TileId, Answer)>;

  Fetcher(dds::Participant& participant, std::string service, std::chrono::milliseconds timeout,
          Arrived arrived)
      : participant_(participant),
        service_(std::move(service)),
        timeout_(timeout),
        arrived_(std::move(arrived)),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

  void add(TileId id) {
    const std::scoped_lock lock(mutex_);
    wanted_.push_back(id);
    changed_.notify_one();
  }

 private:
  void run(const std::stop_token& stop) {
    while (true) {
      const std::vector<TileId> ids = next(stop);
      if (ids.empty()) return;
      fetch(ids, stop);
    }
  }

  /// Those wanted longest; none once it is to stop.
  std::vector<TileId> next(const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return !wanted_.empty(); });
    if (stop.stop_requested()) return {};
    const auto count = std::min(wanted_.size(), max_tiles_per_request);
    const auto end = wanted_.begin() + static_cast<std::ptrdiff_t>(count);
    std::vector<TileId> ids(wanted_.begin(), end);
    wanted_.erase(wanted_.begin(), end);
    return ids;
  }

  void fetch(const std::vector<TileId>& ids, const std::stop_token& stop) {
    std::string fault;
    std::optional<GetTiles_Response> reply;
    try {
      if (!client_) client_.emplace(participant_, service_);
      reply = client_->call(request_for(ids), timeout_, stop);
      if (!reply) fault = "the server does not answer";
    } catch (const dds::DdsError& error) {
      fault = error.what();
    }
    if (reply && reply->status().code() != reply_ok) fault = reply->status().reason();
    if (!fault.empty()) {
      for (const TileId id : ids) arrived_(id, {.tile = nullptr, .fault = fault});
      return;
    }
    hand_on(ids, *reply);
  }

  void hand_on(const std::vector<TileId>& ids, const GetTiles_Response& reply) {
    std::set<TileId> unanswered(ids.begin(), ids.end());
    const auto answer = [&](TileId id, Answer said) {
      if (unanswered.erase(id) > 0) arrived_(id, std::move(said));
    };
    const dds::MapIdentity map = wire::from_wire(reply.identity());
    for (const auto& message : reply.tiles()) {
      const TileId id{message.tile_x(), message.tile_y()};
      const std::optional<Tile> tile = wire::from_wire(message);
      if (!tile) {
        answer(id, {.tile = nullptr, .fault = "the server has another version"});
        continue;
      }
      answer(id, {.tile = std::make_shared<EncodedTile>(
                      EncodedTile{tile->info.content_hash, encode_tile(*tile, map)}),
                  .fault = {}});
    }
    for (const auto& id : reply.missing()) answer({id.x(), id.y()}, {});
    // What did not fit into the answer comes with the next one, where there was anything.
    const bool is_empty = reply.tiles().empty() && reply.missing().empty();
    if (!is_empty) {
      const std::scoped_lock lock(mutex_);
      for (const auto& id : reply.remaining()) {
        if (unanswered.erase({id.x(), id.y()}) > 0)
          wanted_.insert(wanted_.begin(), {id.x(), id.y()});
      }
    }
    const std::set<TileId> unread = std::exchange(unanswered, {});
    for (const TileId id : unread) {
      arrived_(id, {.tile = nullptr, .fault = "the server could not read the tile; ask again"});
    }
  }

  dds::Participant& participant_;
  std::string service_;
  std::chrono::milliseconds timeout_;
  Arrived arrived_;
  std::optional<dds::ServiceClient<GetTiles_Request, GetTiles_Response>> client_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::vector<TileId> wanted_;
  std::jthread thread_;
};

TileSource::TileSource(dds::Participant& participant, const std::string& server_name,
                       std::chrono::milliseconds timeout, Post post)
    : fetcher_(std::make_unique<Fetcher>(
          participant, dds::services::get_tiles.in(server_name), timeout,
          [this, post = std::move(post)](TileId id, Answer answer) {
            post([this, id, answer = std::move(answer)] { arrived(id, answer); });
          })) {}

TileSource::~TileSource() = default;

void TileSource::get(TileId id, std::uint64_t content_hash,
                     std::function<void(const Answer&)> answered) {
  if (const auto found = kept_.find({id, content_hash}); found != kept_.end()) {
    uses_.splice(uses_.end(), uses_, found->second.use);
    return answered({.tile = found->second.tile, .fault = {}});
  }
  auto& waiting = waiting_[id];
  waiting.push_back({content_hash, std::move(answered)});
  if (waiting.size() == 1) fetcher_->add(id);
}

void TileSource::arrived(TileId id, const Answer& answer) {
  const auto found = waiting_.find(id);
  if (found == waiting_.end()) return;
  auto waiting = std::move(found->second);
  waiting_.erase(found);
  if (answer.tile) keep({id, answer.tile->content_hash}, answer.tile);
  // The answer may be of before a later one's state: that one is asked for once more. Whose state
  // it is not even then gets what there is, which is newer.
  std::vector<Waiting> others;
  for (Waiting& one : waiting) {
    const bool is_other = answer.tile && answer.tile->content_hash != one.content_hash;
    if (is_other && !one.is_asked_again && one.content_hash != waiting.front().content_hash) {
      one.is_asked_again = true;
      others.push_back(std::move(one));
    } else {
      one.answered(answer);
    }
  }
  if (others.empty()) return;
  auto& again = waiting_[id];
  const bool is_asked = !again.empty();
  std::ranges::move(others, std::back_inserter(again));
  if (!is_asked) fetcher_->add(id);
}

void TileSource::keep(const Key& key, const std::shared_ptr<const EncodedTile>& tile) {
  const auto [place, is_new] = kept_.try_emplace(key, Kept{tile, {}});
  if (!is_new) return;
  place->second.use = uses_.insert(uses_.end(), key);
  kept_bytes_ += tile->bytes.size();
  while (kept_bytes_ > max_kept_bytes && kept_.size() > 1) {
    const auto oldest = kept_.find(uses_.front());
    kept_bytes_ -= oldest->second.tile->bytes.size();
    kept_.erase(oldest);
    uses_.pop_front();
  }
}

}  // namespace stillmap::gateway
