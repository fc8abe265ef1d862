#include "core/map/scan_stamps.hpp"

#include <algorithm>

namespace stillmap {

std::uint32_t ScanStamps::add(std::int64_t stamp_ns) {
  const auto next = static_cast<std::uint32_t>(stamps_ns_.size());
  if (ascending_.empty() || stamp_ns > stamps_ns_[ascending_.back()]) {
    ascending_.push_back(next);
    stamps_ns_.push_back(stamp_ns);
    return next;
  }
  const auto found = std::ranges::lower_bound(
      ascending_, stamp_ns, {}, [this](std::uint32_t number) { return stamps_ns_[number]; });
  if (stamps_ns_[*found] == stamp_ns) return *found;
  const auto [other, is_new] = others_.try_emplace(stamp_ns, next);
  if (is_new) stamps_ns_.push_back(stamp_ns);
  return other->second;
}

void ScanStamps::clear() { *this = {}; }

std::size_t ScanStamps::memory_bytes() const {
  // A bucket holds its entry and its probe distance.
  return stamps_ns_.capacity() * sizeof(std::int64_t) +
         ascending_.capacity() * sizeof(std::uint32_t) +
         others_.bucket_count() * (sizeof(decltype(others_)::value_type) + 8);
}

}  // namespace stillmap
