#include "core/odometry/ring_order.hpp"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace stillmap {

RingOrder::RingOrder(const Scan& scan) : order_(scan.size()) {
  assert(scan.ring.size() == scan.size());
  const std::size_t rings =
      scan.empty() ? 0 : std::size_t{*std::ranges::max_element(scan.ring)} + 1;
  begin_.assign(rings + 1, 0);
  for (const std::uint16_t ring : scan.ring) ++begin_[ring + 1U];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end());
  for (std::uint32_t i = 0; i < scan.size(); ++i) order_[next[scan.ring[i]]++] = i;
}

}  // namespace stillmap
