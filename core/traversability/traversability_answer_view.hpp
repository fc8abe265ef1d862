#pragma once

#include "core/traversability/traversability_query.hpp"

namespace stillmap {

/// The cells of an answer as a view, to draw, count or ask further. Of the surface, only the height
/// of known ground is in it; clearances are not (0). @pre the answer's status is ok and it has a
/// grid.
[[nodiscard]] TraversabilityView view_of_answer(const TraversabilityAnswer& answer,
                                                const RobotProfile& profile);

}  // namespace stillmap
