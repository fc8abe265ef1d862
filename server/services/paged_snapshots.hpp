#pragma once

#include <chrono>
#include <cstdint>
#include <list>
#include <memory>

#include "core/map/tile.hpp"

namespace stillmap {

/// Views of the map that clients page through, so that all pages of an answer show one version. A
/// view holds the memory of every tile that has changed since, so it goes soon after the last page,
/// or when nobody has asked for the next one for long. One thread uses it.
class PagedViews {
 public:
  using Clock = std::chrono::steady_clock;
  using View = std::shared_ptr<const MapView>;

  /// Between two pages. A page of 8 MB takes `wifi` 11 s, and ten planners share its rate.
  static constexpr std::chrono::seconds longest_pause{150};
  /// After a last page: requests are repeated when their answers are lost, and others may be
  /// reading the same version.
  static constexpr std::chrono::seconds last_page_repeats{10};
  /// Beyond it, the one that was asked for longest ago goes.
  static constexpr std::size_t most_views = 16;

  /// Nothing when no answer of this version is under way.
  [[nodiscard]] View find(std::uint64_t version) const;

  /// A page was given, and there are more.
  void keep(const View& view, Clock::time_point now);
  /// The last page of an answer was given.
  void end(const View& view, Clock::time_point now);

  /// Lets go of views that nobody asks for any more.
  void forget_abandoned(Clock::time_point now);

  [[nodiscard]] std::size_t size() const { return under_way_.size(); }

 private:
  struct UnderWay {
    View view;
    Clock::time_point until;
  };

  [[nodiscard]] std::list<UnderWay>::iterator entry_of(const View& view);

  // Those asked for most recently first.
  std::list<UnderWay> under_way_;
};

}  // namespace stillmap
