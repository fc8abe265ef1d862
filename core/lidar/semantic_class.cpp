#include "core/lidar/semantic_class.hpp"

#include <algorithm>

namespace stillmap {
namespace {

struct ClassFacts {
  std::string_view name;
  Rgb colour;
  std::uint16_t semantic_kitti_id;
};

// Row n is class n. From semantic-kitti.yaml (whose colours are BGR; here they are RGB).
constexpr std::array<ClassFacts, semantic_class_count> facts{{
    {"unlabeled", {0, 0, 0}, 0},         {"car", {100, 150, 245}, 10},
    {"bicycle", {100, 230, 245}, 11},    {"motorcycle", {30, 60, 150}, 15},
    {"truck", {80, 30, 180}, 18},        {"other-vehicle", {0, 0, 255}, 20},
    {"person", {255, 30, 30}, 30},       {"bicyclist", {255, 40, 200}, 31},
    {"motorcyclist", {150, 30, 90}, 32}, {"road", {255, 0, 255}, 40},
    {"parking", {255, 150, 255}, 44},    {"sidewalk", {75, 0, 75}, 48},
    {"other-ground", {175, 0, 75}, 49},  {"building", {255, 200, 0}, 50},
    {"fence", {255, 120, 50}, 51},       {"vegetation", {0, 175, 0}, 70},
    {"trunk", {135, 60, 0}, 71},         {"terrain", {150, 240, 80}, 72},
    {"pole", {255, 240, 150}, 80},       {"traffic-sign", {255, 0, 0}, 81},
}};

const ClassFacts& facts_of(SemanticClass label) {
  const auto index = static_cast<std::size_t>(label);
  return facts[index < facts.size() ? index : 0];
}

}  // namespace

std::string_view name(SemanticClass label) { return facts_of(label).name; }

std::optional<SemanticClass> class_from_name(std::string_view class_name) {
  const auto found = std::ranges::find(facts, class_name, &ClassFacts::name);
  if (found == facts.end()) return std::nullopt;
  return static_cast<SemanticClass>(found - facts.begin());
}

Rgb colour(SemanticClass label) { return facts_of(label).colour; }

std::uint16_t semantic_kitti_id(SemanticClass label) { return facts_of(label).semantic_kitti_id; }

bool has_known_class(std::span<const SemanticClass> labels) {
  return std::ranges::any_of(labels,
                             [](SemanticClass label) { return label != SemanticClass::unlabeled; });
}

SemanticClass class_from_semantic_kitti(std::uint16_t original_id) {
  switch (original_id) {
    case 13:   // bus
    case 16:   // on-rails
    case 256:  // moving-on-rails
    case 257:  // moving-bus
    case 259:  // moving-other-vehicle
      return SemanticClass::other_vehicle;
    case 60:  // lane-marking
      return SemanticClass::road;
    case 252:
      return SemanticClass::car;
    case 253:
      return SemanticClass::bicyclist;
    case 254:
      return SemanticClass::person;
    case 255:
      return SemanticClass::motorcyclist;
    case 258:
      return SemanticClass::truck;
    default:
      break;
  }
  const auto found = std::ranges::find(facts, original_id, &ClassFacts::semantic_kitti_id);
  if (found == facts.end()) return SemanticClass::unlabeled;
  return static_cast<SemanticClass>(found - facts.begin());
}

}  // namespace stillmap
