#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/map/query/map_query.hpp"
#include "core/map/tile.hpp"

namespace stillmap::server {

/// Views of the map that clients page through, so that all pages of an answer show one version. A
/// view holds the memory of every tile that has changed since, so it goes soon after the last page,
/// or when nobody has asked for the next one for long. Any number of clients may page as long as
/// their views hold no more than `max_bytes`. One thread at a time uses it.
class PagedSnapshots {
 public:
  using Clock = std::chrono::steady_clock;
  using Snapshot = std::shared_ptr<const MapSnapshot>;

  /// Between two pages. A page takes a slow network some 2 s, and ten planners share its rate.
  static constexpr std::chrono::seconds max_page_interval{150};
  /// After a last page: requests are repeated when their answers are lost, and others may be
  /// reading the same version.
  static constexpr std::chrono::seconds last_page_grace{10};
  static constexpr std::size_t default_max_bytes = std::size_t{64} << 20;

  /// Beyond `max_bytes`, the view that was asked for longest ago goes.
  explicit PagedSnapshots(std::size_t max_bytes = default_max_bytes) : max_bytes_(max_bytes) {}

  /// Nothing when no answer from this state of this map is under way.
  [[nodiscard]] Snapshot find(const MapVersion& map) const;

  /// A page was given, and there are more.
  void keep(const Snapshot& view, Clock::time_point now);
  /// The last page of an answer was given.
  void end(const Snapshot& view, Clock::time_point now);

  /// Lets go of views that nobody asks for any more.
  void drop_expired(Clock::time_point now);

  [[nodiscard]] std::size_t size() const { return sessions_.size(); }
  /// About what the views take beside the newest of them.
  [[nodiscard]] std::size_t bytes() const;

 private:
  struct Session {
    Snapshot view;
    Clock::time_point asked;
    Clock::time_point until;
    /// Of what the next newer view does not share.
    std::size_t bytes = 0;
  };
  using Sessions = std::vector<Session>;

  [[nodiscard]] Sessions::iterator session_of(const Snapshot& view);
  void erase(Sessions::iterator session);
  /// Brings the session's `bytes` up to date with the one after it.
  void weigh(Sessions::iterator session);

  std::size_t max_bytes_;
  /// In the order in which their views were first asked for, and so of their versions.
  Sessions sessions_;
};

}  // namespace stillmap::server
