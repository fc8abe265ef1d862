#pragma once

#include <chrono>
#include <cstdint>
#include <list>
#include <memory>

#include "core/map/tile.hpp"

namespace stillmap::server {

/// Views of the map that clients page through, so that all pages of an answer show one version. A
/// view holds the memory of every tile that has changed since, so it goes soon after the last page,
/// or when nobody has asked for the next one for long. One thread uses it.
class PagedSnapshots {
 public:
  using Clock = std::chrono::steady_clock;
  using Snapshot = std::shared_ptr<const MapSnapshot>;

  /// Between two pages. A page of 8 MB takes `wifi` 11 s, and ten planners share its rate.
  static constexpr std::chrono::seconds max_page_interval{150};
  /// After a last page: requests are repeated when their answers are lost, and others may be
  /// reading the same version.
  static constexpr std::chrono::seconds last_page_grace{10};
  /// Beyond it, the one that was asked for longest ago goes.
  static constexpr std::size_t max_snapshots = 16;

  /// Nothing when no answer of this version is under way.
  [[nodiscard]] Snapshot find(std::uint64_t version) const;

  /// A page was given, and there are more.
  void keep(const Snapshot& view, Clock::time_point now);
  /// The last page of an answer was given.
  void end(const Snapshot& view, Clock::time_point now);

  /// Lets go of views that nobody asks for any more.
  void drop_expired(Clock::time_point now);

  [[nodiscard]] std::size_t size() const { return sessions_.size(); }

 private:
  struct Session {
    Snapshot view;
    Clock::time_point until;
  };

  [[nodiscard]] std::list<Session>::iterator entry_of(const Snapshot& view);

  // Those asked for most recently first.
  std::list<Session> sessions_;
};

}  // namespace stillmap::server
