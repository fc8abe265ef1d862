#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/map/live_tile.hpp"

namespace stillmap {

/// Answers for each place by itself: `answer(position_map, thin)`.
template <typename Answer>
[[nodiscard]] VisibilityTest::Ask ask_each(Answer answer) {
  return [answer](std::span<const PlaceToClear> places, std::span<std::uint32_t> answers) {
    for (std::size_t k = 0; k < places.size(); ++k)
      answers[k] = static_cast<std::uint32_t>(answer(places[k].position_map, places[k].thin));
  };
}

}  // namespace stillmap
