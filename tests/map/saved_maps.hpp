#pragma once

#include <gmock/gmock.h>

#include "core/map/storage/map_file.hpp"

namespace stillmap::test {

/// A small map with everything that a map file holds, different for each `seed`.
[[nodiscard]] SavedMap saved_map(int seed);

/// Expects two stored maps to be the same in everything.
void expect_equal(const SavedMap& a, const SavedMap& b);

}  // namespace stillmap::test
