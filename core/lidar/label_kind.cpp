#include "core/lidar/label_kind.hpp"

#include <algorithm>
#include <array>

namespace stillmap {
namespace {

/// `labels` of semantic-kitti.yaml. 0, 1, 52 and 99 are ids, too, although no class.
constexpr auto known_ids = [] {
  std::array<bool, 260> known{};
  for (const int id : {0,  1,  10, 11, 13, 15, 16, 18, 20, 30,  31,  32,  40,  44,  48,  49,  50,
                       51, 52, 60, 70, 71, 72, 80, 81, 99, 252, 253, 254, 255, 256, 257, 258, 259})
    known[static_cast<std::size_t>(id)] = true;
  return known;
}();

/// The upper half of a SemanticKITTI label is the instance.
constexpr std::uint32_t id_bits = 0xFFFFU;

}  // namespace

SemanticClass class_of_label(std::uint32_t raw_label, LabelKind kind) {
  if (kind == LabelKind::semantic_kitti)
    return class_from_semantic_kitti(static_cast<std::uint16_t>(raw_label & id_bits));
  return raw_label < semantic_class_count ? static_cast<SemanticClass>(raw_label)
                                          : SemanticClass::unlabeled;
}

void LabelCensus::add(std::uint32_t raw_label) {
  const std::uint32_t id = raw_label & id_bits;
  ++labels_;
  unknown_ += id < known_ids.size() && known_ids[id] ? 0U : 1U;
  largest_ = std::max(largest_, raw_label);
}

}  // namespace stillmap
