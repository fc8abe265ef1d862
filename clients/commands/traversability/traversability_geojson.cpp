#include "clients/commands/traversability/traversability_geojson.hpp"

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace stillmap::cli {
namespace {

/// GeoJSON repeats the first corner at the end.
nlohmann::json closed(const TraversableRing& ring) {
  nlohmann::json corners = nlohmann::json::array();
  for (const Eigen::Vector2d& corner : ring) corners.push_back({corner.x(), corner.y()});
  if (!ring.empty()) corners.push_back({ring.front().x(), ring.front().y()});
  return corners;
}

nlohmann::json feature(const TraversablePolygon& polygon) {
  nlohmann::json rings = nlohmann::json::array({closed(polygon.outer)});
  for (const TraversableRing& hole : polygon.holes) rings.push_back(closed(hole));
  return {{"type", "Feature"},
          {"properties", {{"area_m2", area_m2(polygon)}}},
          {"geometry", {{"type", "Polygon"}, {"coordinates", std::move(rings)}}}};
}

}  // namespace

nlohmann::json to_json(const TraversabilityAnswer& answer, const std::string& profile) {
  nlohmann::json features = nlohmann::json::array();
  for (const TraversablePolygon& polygon : answer.outlines) features.push_back(feature(polygon));
  return {{"type", "FeatureCollection"},
          {"frame", "map"},
          {"unit", "m"},
          {"profile", profile},
          {"map_version", answer.grid.map_version},
          {"features", std::move(features)}};
}

void write_outlines(const std::string& file, const TraversabilityAnswer& answer,
                    const std::string& profile) {
  std::ofstream stream(file, std::ios::trunc);
  stream << to_json(answer, profile).dump(1) << "\n";
  stream.close();
  if (!stream) {
    throw std::runtime_error(file + ": cannot be written; its folder must exist and be writable");
  }
}

}  // namespace stillmap::cli
