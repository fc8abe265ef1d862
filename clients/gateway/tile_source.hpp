#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "clients/gateway/post.hpp"
#include "core/map/tile_table.hpp"
#include "idl/dds/participant.hpp"

namespace stillmap::gateway {

/// A tile in the page's format, in the state of this hash.
struct EncodedTile {
  std::uint64_t content_hash = 0;
  std::string bytes;
};

/// Tiles of the server's map for the page: fetched with get_tiles, many at once where many are
/// asked for, and kept while there is room. One thread uses it, that of `post`.
class TileSource {
 public:
  TileSource(dds::Participant& participant, const std::string& server_name,
             std::chrono::milliseconds timeout, Post post);
  ~TileSource();
  TileSource(const TileSource&) = delete;
  TileSource& operator=(const TileSource&) = delete;

  struct Answer {
    /// As asked for, or newer; null where the map has no such tile, or there was no answer.
    std::shared_ptr<const EncodedTile> tile;
    /// Why there was no answer.
    std::string fault;
  };
  /// `answered` is called once, from the thread of `post`.
  void get(TileId id, std::uint64_t content_hash, std::function<void(const Answer&)> answered);
  /// Nobody who waits is answered any more.
  void forget_waiting() { waiting_.clear(); }

 private:
  class Fetcher;
  struct Key {
    TileId id;
    std::uint64_t content_hash = 0;
    friend auto operator<=>(const Key&, const Key&) = default;
  };
  struct Kept {
    std::shared_ptr<const EncodedTile> tile;
    std::list<Key>::iterator use;
  };

  void arrived(TileId id, const Answer& answer);
  void keep(const Key& key, const std::shared_ptr<const EncodedTile>& tile);

  std::map<Key, Kept> kept_;
  /// Keys of `kept_`, the longest unused first.
  std::list<Key> uses_;
  std::size_t kept_bytes_ = 0;
  struct Waiting {
    std::uint64_t content_hash = 0;
    std::function<void(const Answer&)> answered;
    /// What came was asked for before this state was known.
    bool is_asked_again = false;
  };
  std::map<TileId, std::vector<Waiting>> waiting_;
  std::unique_ptr<Fetcher> fetcher_;
};

}  // namespace stillmap::gateway
