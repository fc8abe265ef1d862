#include "core/occupancy/octree_encoding.hpp"

#include <octomap/OcTree.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "core/occupancy/octree_parts.hpp"

namespace stillmap {
namespace {

using octomap::OcTree;
using octomap::OcTreeNode;

/// A node that was written: as binary data has it in its parent's two bits.
enum class Written : unsigned { absent = 0, free = 1, occupied = 2, inner = 3 };

struct WrittenNode {
  Written kind = Written::absent;
  float log_odds = -std::numeric_limits<float>::infinity();
};
using WrittenChildren = std::array<WrittenNode, 8>;

/// Writes nodes depth first. An inner node is begun, then its children are written, then it is
/// ended, since only then it is known what it has.
class NodeWriter {
 public:
  NodeWriter(const OcTree& octree, OctomapEncoding encoding)
      : octree_(octree), is_binary_(encoding == OctomapEncoding::binary) {}

  /// The node with all below it.
  WrittenNode write(const OcTreeNode& node, std::string& out) const {
    if (!octree_.nodeHasChildren(&node)) return write_leaf(node, out);
    const std::size_t begin = begin_inner(out);
    WrittenChildren children;
    for (unsigned i = 0; i < 8; ++i) {
      if (octree_.nodeChildExists(&node, i))
        children[i] = write(*octree_.getNodeChild(&node, i), out);
    }
    return end_inner(children, &node == octree_.getRoot(), begin, out);
  }

  /// Where the node begins in `out`.
  [[nodiscard]] std::size_t begin_inner(std::string& out) const {
    const std::size_t begin = out.size();
    out.append(is_binary_ ? 2 : sizeof(float) + 1, '\0');
    return begin;
  }

  /// Nothing is left of it in `out` where it has no children, or is written as a leaf.
  WrittenNode end_inner(const WrittenChildren& children, bool is_root, std::size_t begin,
                        std::string& out) const {
    WrittenNode node;
    unsigned kinds = 0;
    unsigned present = 0;
    for (unsigned i = 0; i < 8; ++i) {
      if (children[i].kind == Written::absent) continue;
      kinds |= static_cast<unsigned>(children[i].kind) << (2 * i);
      present |= 1U << i;
      node.log_odds = std::max(node.log_odds, children[i].log_odds);
    }
    if (present == 0) {
      out.resize(begin);
      return node;
    }
    if (!is_binary_) {
      put(node.log_odds, present, begin, out);
      node.kind = Written::inner;
    } else if (!is_root && (kinds == all_free || kinds == all_occupied)) {
      // As OctoMap prunes it.
      out.resize(begin);
      node.kind = children[0].kind;
    } else {
      out[begin] = static_cast<char>(kinds & 0xFFU);
      out[begin + 1] = static_cast<char>(kinds >> 8U);
      node.kind = Written::inner;
    }
    return node;
  }

 private:
  static constexpr unsigned all_free = 0x5555;
  static constexpr unsigned all_occupied = 0xAAAA;

  WrittenNode write_leaf(const OcTreeNode& leaf, std::string& out) const {
    if (!is_binary_) put(leaf.getLogOdds(), 0, begin_inner(out), out);
    return {.kind = octree_.isNodeOccupied(&leaf) ? Written::occupied : Written::free,
            .log_odds = leaf.getLogOdds()};
  }

  static void put(float log_odds, unsigned children, std::size_t at, std::string& out) {
    std::memcpy(out.data() + at, &log_odds, sizeof(float));
    out[at + sizeof(float)] = static_cast<char>(children);
  }

  const OcTree& octree_;
  bool is_binary_;
};

/// Puts the nodes above the parts round them.
class Assembly {
 public:
  struct Piece {
    OctreePart part;
    WrittenNode node;
    std::string bytes;
  };

  Assembly(const NodeWriter& writer, std::vector<Piece> pieces, const ThrottleCallback& pause)
      : writer_(writer), pieces_(std::move(pieces)), next_(pieces_.begin()), pause_(pause) {}

  [[nodiscard]] std::string whole() {
    // At once: a string that grows is copied whole, without a pause.
    constexpr std::size_t bytes_of_nodes_above = 20;
    std::size_t bytes = 0;
    for (const Piece& piece : pieces_) bytes += piece.bytes.size() + bytes_of_nodes_above;
    std::string out;
    out.reserve(bytes);
    if (next_ != pieces_.end()) write(OctreePart(), out);
    return out;
  }

 private:
  WrittenNode write(const OctreePart& place, std::string& out) {
    if (next_->part == place) {
      if (pause_) pause_();
      out += next_->bytes;
      // Of a large map, both would be in memory at once.
      next_->bytes = std::string();
      return (next_++)->node;
    }
    const std::size_t begin = writer_.begin_inner(out);
    WrittenChildren children;
    for (unsigned i = 0; i < 8 && next_ != pieces_.end(); ++i) {
      const OctreePart child = place.child(i);
      if (child.contains(next_->part)) children[i] = write(child, out);
    }
    return writer_.end_inner(children, place.side == octree_side, begin, out);
  }

  const NodeWriter& writer_;
  std::vector<Piece> pieces_;
  std::vector<Piece>::iterator next_;
  const ThrottleCallback& pause_;
};

}  // namespace

std::string encode_octree(const OcTree& octree, OctomapEncoding encoding,
                          const ThrottleCallback& pause) {
  const NodeWriter writer(octree, encoding);
  const OctreeParts found = parts_of(octree, VoxelKey::Zero(), VoxelKey::Constant(octree_side - 1));
  std::vector<Assembly::Piece> pieces;
  pieces.reserve(found.parts.size());
  for (const OctreePart& part : found.parts) {
    if (pause) pause();
    Assembly::Piece& piece =
        pieces.emplace_back(Assembly::Piece{.part = part, .node = {}, .bytes = {}});
    if (const OcTreeNode* const node = node_of(octree, part); node != nullptr)
      piece.node = writer.write(*node, piece.bytes);
  }
  return Assembly(writer, std::move(pieces), pause).whole();
}

}  // namespace stillmap
