#include "core/map/map_id.hpp"

#include <random>

namespace stillmap {

std::uint64_t new_map_id() {
  std::random_device entropy;
  // 63 bits: SQLite and many clients' languages have signed integers only.
  std::uniform_int_distribution<std::uint64_t> ids(1, UINT64_MAX >> 1);
  return ids(entropy);
}

}  // namespace stillmap
