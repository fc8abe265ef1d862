#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace stillmap {

/// The 19 classes of the SemanticKITTI single-scan task, and 0 for "no label". The order is the
/// order of the network's outputs.
enum class SemanticClass : std::uint8_t {
  unlabeled = 0,
  car = 1,
  bicycle = 2,
  motorcycle = 3,
  truck = 4,
  other_vehicle = 5,
  person = 6,
  bicyclist = 7,
  motorcyclist = 8,
  road = 9,
  parking = 10,
  sidewalk = 11,
  other_ground = 12,
  building = 13,
  fence = 14,
  vegetation = 15,
  trunk = 16,
  terrain = 17,
  pole = 18,
  traffic_sign = 19,
};

inline constexpr std::size_t semantic_class_count = 20;

struct Rgb {
  std::uint8_t r = 0, g = 0, b = 0;
  friend bool operator==(const Rgb&, const Rgb&) = default;
};

/// SemanticKITTI's name of the class ("other-vehicle").
[[nodiscard]] std::string_view name(SemanticClass label);

/// The class of that name; nothing if there is none.
[[nodiscard]] std::optional<SemanticClass> class_from_name(std::string_view class_name);

/// SemanticKITTI's colour of the class.
[[nodiscard]] Rgb colour(SemanticClass label);

/// Vehicles and people: what may move, now or later (classes 1..8; semi-static in the paper,
/// II-C.2).
[[nodiscard]] constexpr bool is_movable(SemanticClass label) {
  return label >= SemanticClass::car && label <= SemanticClass::motorcyclist;
}

/// Road, parking, sidewalk, other-ground, terrain.
[[nodiscard]] constexpr bool is_ground(SemanticClass label) {
  return (label >= SemanticClass::road && label <= SemanticClass::other_ground) ||
         label == SemanticClass::terrain;
}

/// Fence, trunk, pole, traffic-sign: often thinner than beams are apart.
[[nodiscard]] constexpr bool is_thin(SemanticClass label) {
  return label == SemanticClass::fence || label == SemanticClass::trunk ||
         label == SemanticClass::pole || label == SemanticClass::traffic_sign;
}

/// Whether any of them is a class. Fields that nobody filled hold zeros: those are no labels.
[[nodiscard]] bool has_known_class(std::span<const SemanticClass> labels);

/// Class of an original SemanticKITTI id (the low 16 bits of a .label entry), as `learning_map`
/// of the data set's configuration gives it: moving-car becomes car, lane-marking becomes road.
/// Unknown ids give `unlabeled`.
[[nodiscard]] SemanticClass class_from_semantic_kitti(std::uint16_t original_id);

/// The original id that stands for a class (`learning_map_inv`).
[[nodiscard]] std::uint16_t semantic_kitti_id(SemanticClass label);

/// Original ids 252..259: objects that were moving. Truth for evaluation, never an input to
/// odometry or map.
[[nodiscard]] constexpr bool is_moving_semantic_kitti(std::uint16_t original_id) {
  return original_id >= 252 && original_id <= 259;
}

}  // namespace stillmap
