#pragma once

#include <chrono>
#include <cstdint>
#include <list>
#include <memory>

#include "core/map/tile.hpp"

namespace stillmap {

/// Views of the map that clients page through, so that all pages of an answer show one version. A
/// view holds the memory of every tile that has changed since, so it goes with the last page, or
/// when nobody has asked for the next one for a while. One thread uses it.
class PagedViews {
 public:
  using Clock = std::chrono::steady_clock;
  using View = std::shared_ptr<const MapView>;

  /// A client that is slower than this begins again.
  static constexpr std::chrono::seconds longest_pause{30};
  /// Answers under way at the same time; beyond it the one that was asked for longest ago ends.
  static constexpr std::size_t most_views = 16;

  /// Nothing when no answer of this version is under way.
  [[nodiscard]] View find(std::uint64_t version) const;

  /// The first page of an answer was given, and there are more.
  void begin(const View& view, Clock::time_point now);
  /// A further page was given, and there are more.
  void go_on(const View& view, Clock::time_point now);
  /// The last page of an answer was given.
  void end(const View& view);

  /// Gives up answers whose clients ask no more.
  void forget_abandoned(Clock::time_point now);

  [[nodiscard]] std::size_t size() const { return under_way_.size(); }

 private:
  struct UnderWay {
    View view;
    /// Of this version.
    int answers = 0;
    Clock::time_point last_asked;
  };

  [[nodiscard]] std::list<UnderWay>::iterator entry_of(const View& view);

  // Most recently asked first.
  std::list<UnderWay> under_way_;
};

}  // namespace stillmap
