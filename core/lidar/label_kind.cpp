#include "core/lidar/label_kind.hpp"

#include <array>
#include <string>

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

constexpr std::uint32_t no_label = id_bits;
/// SemanticKITTI's moving motorcyclist, and what data sets of classes call "ignore".
constexpr std::uint32_t ignore = 255;

}  // namespace

SemanticClass class_of_label(std::uint32_t raw_label, LabelKind kind) {
  const std::uint32_t id = raw_label & id_bits;
  if (kind == LabelKind::semantic_kitti)
    return class_from_semantic_kitti(static_cast<std::uint16_t>(id));
  return id < semantic_class_count ? static_cast<SemanticClass>(id) : SemanticClass::unlabeled;
}

void LabelCensus::add(std::uint32_t raw_label) {
  const std::uint32_t id = raw_label & id_bits;
  if (id == 0 || id == no_label) return;
  const bool is_known = id < known_ids.size() && known_ids[id];
  ++labels_;
  unknown_ += is_known ? 0U : 1U;
  classes_alone_ += !is_known && id < semantic_class_count ? 1U : 0U;
  beyond_classes_ += id >= semantic_class_count && id != ignore ? 1U : 0U;
}

std::string LabelCensus::doubt() const {
  const std::string unknown = std::to_string(unknown_) + " of " + std::to_string(labels_) +
                              " labels are no ids of SemanticKITTI";
  if (look_like_classes()) {
    const std::string beyond =
        beyond_classes_ == 0 ? "none" : "only " + std::to_string(beyond_classes_);
    return "look like classes 0 to 19: " + unknown + ", and " + beyond + " beyond 19";
  }
  return 2 * unknown_ > labels_ ? "are mostly something else: " + unknown : std::string();
}

}  // namespace stillmap
