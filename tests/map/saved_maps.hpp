#pragma once

#include <gmock/gmock.h>

#include "core/map/storage/map_file.hpp"

namespace stillmap::test {

/// A small map with everything that a map file holds, different for each `seed`.
[[nodiscard]] StoredMap stored_map(int seed);

/// Expects two stored maps to be the same in everything.
void expect_equal(const StoredMap& a, const StoredMap& b);

}  // namespace stillmap::test
