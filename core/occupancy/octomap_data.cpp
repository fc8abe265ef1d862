#include "core/occupancy/octomap_data.hpp"

#include <bit>
#include <cmath>
#include <cstring>
#include <sstream>

namespace stillmap {
namespace {

/// Levels below the root.
constexpr unsigned tree_depth = 16;

/// Reads nodes in the order in which they are written: depth first, children in order.
class EncodingWalk {
 public:
  explicit EncodingWalk(const OctomapData& data) : bytes_(data.bytes), encoding_(data.encoding) {}

  OctomapCheck check() {
    if (bytes_.empty()) return result_;
    ++result_.nodes;
    encoding_ == OctomapEncoding::binary ? read_binary_node(0) : read_full_node(0);
    if (result_.fault.empty() && at_ != bytes_.size()) {
      fail(std::to_string(bytes_.size() - at_) + " bytes follow the octree's end");
    }
    return result_;
  }

 private:
  void fail(const std::string& fault) {
    if (result_.fault.empty()) result_.fault = fault;
  }

  [[nodiscard]] bool has(std::size_t count) {
    if (bytes_.size() - at_ >= count) return true;
    fail("the octree ends after " + std::to_string(bytes_.size()) +
         " bytes, in the middle of a node");
    return false;
  }

  [[nodiscard]] unsigned next_byte() { return static_cast<unsigned char>(bytes_[at_++]); }

  /// Two bits a child: 01 free, 10 occupied, 11 has children itself, 00 unknown.
  void read_binary_node(unsigned depth) {
    if (!has(2)) return;
    const unsigned low = next_byte();
    const unsigned children = low | next_byte() << 8U;
    if (children == 0) return fail("an inner node has no children");
    for (unsigned i = 0; i < 8; ++i) {
      if ((children >> (2 * i) & 3U) != 0) ++result_.nodes;
    }
    for (unsigned i = 0; i < 8 && result_.fault.empty(); ++i) {
      if ((children >> (2 * i) & 3U) != 3U) continue;
      if (depth + 1 >= tree_depth) return fail("the octree is deeper than 16 levels");
      read_binary_node(depth + 1);
    }
  }

  /// Log-odds, and a bit a child.
  void read_full_node(unsigned depth) {
    if (!has(sizeof(float) + 1)) return;
    float log_odds = 0.0F;
    std::memcpy(&log_odds, bytes_.data() + at_, sizeof(float));
    at_ += sizeof(float);
    if (!std::isfinite(log_odds)) return fail("a node's log-odds are not finite");
    const unsigned children = next_byte();
    if (children != 0 && depth >= tree_depth) return fail("the octree is deeper than 16 levels");
    result_.nodes += static_cast<std::uint64_t>(std::popcount(children));
    for (unsigned i = 0; i < 8 && result_.fault.empty(); ++i) {
      if ((children >> i & 1U) != 0) read_full_node(depth + 1);
    }
  }

  const std::string& bytes_;
  OctomapEncoding encoding_;
  std::size_t at_ = 0;
  OctomapCheck result_;
};

}  // namespace

OctomapCheck check_octomap(const OctomapData& data) {
  // Of what the octree's 2^16 voxels a side can be counted in.
  constexpr double finest_m = 1e-6;
  constexpr double coarsest_m = 1e6;
  if (data.resolution_m >= finest_m && data.resolution_m <= coarsest_m)
    return EncodingWalk(data).check();
  std::ostringstream fault;
  fault << "a resolution of " << data.resolution_m << " m; it must be " << finest_m << " to "
        << coarsest_m;
  return {.nodes = 0, .fault = fault.str()};
}

}  // namespace stillmap
