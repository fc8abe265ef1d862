#include "core/evaluation/class_groups.hpp"

namespace stillmap::evaluation {
namespace {

using enum SemanticClass;

constexpr std::array drivable{road, parking};
constexpr std::array other_ground_group{sidewalk, other_ground};
constexpr std::array structure{building, fence};
constexpr std::array vehicle{car, bicycle, motorcycle, truck, other_vehicle};
constexpr std::array people{person, bicyclist, motorcyclist};
constexpr std::array nature{vegetation, trunk, terrain};
constexpr std::array pole_like{pole, traffic_sign};

}  // namespace

std::array<ClassGroup, 7> coarse_groups() {
  return {{{"drivable", drivable},
           {"other ground", other_ground_group},
           {"structure", structure},
           {"vehicle", vehicle},
           {"person", people},
           {"nature", nature},
           {"pole-like", pole_like}}};
}

}  // namespace stillmap::evaluation
