#include <xxhash.h>

#include <bit>

#include "core/map/query/query_checks.hpp"

namespace stillmap {
namespace {

/// What a query consists of, as whole numbers one after the other.
class Words {
 public:
  void add(std::uint64_t word) { words_.push_back(word); }
  void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
  void add(const HeightRange& heights) {
    add(heights.min_m);
    add(heights.max_m);
  }
  void add(const std::vector<Eigen::Vector2d>& points) {
    for (const Eigen::Vector2d& point : points) {
      add(point.x());
      add(point.y());
    }
  }
  void add(const BoxRegion& box) {
    for (const double value : box.box_map.min()) add(value);
    for (const double value : box.box_map.max()) add(value);
  }
  void add(const SphereRegion& sphere) {
    for (const double value : sphere.centre_map) add(value);
    add(sphere.radius_m);
  }
  void add(const PolygonRegion& polygon) {
    add(polygon.heights);
    add(polygon.corners_map);
  }
  void add(const CorridorRegion& corridor) {
    add(corridor.heights);
    add(corridor.half_width_m);
    add(corridor.path_map);
  }

  [[nodiscard]] std::uint64_t hash() const {
    return XXH3_64bits(words_.data(), words_.size() * sizeof(words_[0]));
  }

 private:
  std::vector<std::uint64_t> words_;
};

}  // namespace

std::uint64_t fingerprint(const MapQuery& query) {
  Words words;
  words.add(static_cast<std::uint64_t>(query.region.index()));
  std::visit([&](const auto& kind) { words.add(kind); }, query.region);
  words.add(std::uint64_t{query.classes.to_ullong()});
  words.add(std::uint64_t{query.motions.to_ullong()});
  words.add(query.resolution_m);
  words.add(std::uint64_t{query.since ? 1U : 0U});
  words.add(query.since.value_or(KnownVersion()).map_id);
  words.add(query.since.value_or(KnownVersion()).version);
  return words.hash();
}

}  // namespace stillmap
