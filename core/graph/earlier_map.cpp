#include "core/graph/earlier_map.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "core/graph/ceiling.hpp"

namespace stillmap {
namespace {

/// The drive's submap turned upright by the map's vertical.
PlacedSubmap levelled(const Submap& submap, const Eigen::Isometry3d& T_map_key) {
  Submap turned = submap;
  turned.T_submap_key = upright_from_key(T_map_key);
  const Eigen::Isometry3f T = (turned.T_submap_key * submap.T_submap_key.inverse()).cast<float>();
  for (Eigen::Vector3f& p : turned.points_submap) p = T * p;
  return PlacedSubmap(std::move(turned));
}

/// The lowest and the highest that points show round a place.
class HeightBands {
 public:
  /// Within one to two `cell_m` of it.
  HeightBands(std::span<const Eigen::Vector3f> points, float cell_m) : cell_m_(cell_m) {
    Eigen::AlignedBox2f box;
    for (const Eigen::Vector3f& p : points) box.extend(p.head<2>());
    if (points.empty()) return;
    // Cells beside those of points, and half a one for rounding.
    corner_ = box.min().array() - 1.5F * cell_m;
    side_ = ((box.max() - corner_) / cell_m).cast<int>().array() + 3;
    bands_.resize(static_cast<std::size_t>(side_.prod()));
    for (const Eigen::Vector3f& p : points) {
      const Eigen::Vector2i cell = cell_of(p);
      for (int y = cell.y() - 1; y <= cell.y() + 1; ++y)
        for (int x = cell.x() - 1; x <= cell.x() + 1; ++x) extend(bands_[index(x, y)], p.z());
    }
  }

  /// Whether a point is within `margin_m` of the band at its place, or there is none.
  [[nodiscard]] bool hold(const Eigen::Vector3f& p, float margin_m) const {
    const Eigen::Vector2i cell = cell_of(p);
    if ((cell.array() < 0).any() || (cell.array() >= side_.array()).any()) return true;
    const Band& band = bands_[index(cell.x(), cell.y())];
    const bool is_empty = band.lowest > band.highest;
    return is_empty || (p.z() > band.lowest - margin_m && p.z() < band.highest + margin_m);
  }

 private:
  struct Band {
    float lowest = std::numeric_limits<float>::infinity();
    float highest = -std::numeric_limits<float>::infinity();
  };
  static void extend(Band& band, float z) {
    band.lowest = std::min(band.lowest, z);
    band.highest = std::max(band.highest, z);
  }
  [[nodiscard]] Eigen::Vector2i cell_of(const Eigen::Vector3f& p) const {
    return ((p.head<2>() - corner_) / cell_m_).array().floor().cast<int>();
  }
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y * side_.x() + x);
  }

  float cell_m_;
  Eigen::Vector2f corner_ = Eigen::Vector2f::Zero();
  Eigen::Vector2i side_ = Eigen::Vector2i::Zero();
  std::vector<Band> bands_;
};

/// Takes out what is above or below all that the drive's submap shows there, wherever in the window
/// it is: another storey, or the street underneath.
void keep_level(Submap& piece, const Submap& mine, const AlignmentWindow& window) {
  constexpr double min_cell_m = 2.0;
  constexpr double over_reach_m = 0.5;
  const HeightBands bands(mine.points_submap,
                          static_cast<float>(std::max(min_cell_m, window.reach_m)));
  const auto margin_m = static_cast<float>(window.reach_height_m + over_reach_m);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < piece.points_submap.size(); ++i) {
    if (!bands.hold(piece.points_submap[i], margin_m)) continue;
    piece.points_submap[kept] = piece.points_submap[i];
    piece.classes[kept++] = piece.classes[i];
  }
  piece.points_submap.resize(kept);
  piece.classes.resize(kept);
}

}  // namespace

std::optional<EarlierMap::Match> EarlierMap::match(const Submap& submap,
                                                   const Eigen::Isometry3d& T_map_key_told,
                                                   double way_m) const {
  // Often that of the match before: rounding that made it no rotation any more would be three times
  // as large in this one, and two percent after thirty.
  const Eigen::Isometry3d T_map_key_expected =
      Eigen::Translation3d(T_map_key_told.translation()) *
      Eigen::Quaterniond(T_map_key_told.linear()).normalized();
  Submap round = piece_round(T_map_key_expected);
  const PlacedSubmap mine = levelled(submap, T_map_key_expected);
  // Both frames are that of the expected pose, upright.
  AlignmentWindow window = window_after(config_.drift, way_m);
  window.has_levels = true;
  const Submap all_levels = round;
  keep_level(round, mine.submap, window);
  if (round.points_submap.empty()) return std::nullopt;
  const PlacedSubmap piece(std::move(round));
  auto found = match_submaps(piece, mine, Eigen::Isometry3d::Identity(), window, config_.match);
  if (!found) return std::nullopt;
  if (found->refusal.empty() && lacks_ceiling(mine.submap, all_levels, found->T_a_b))
    found->refusal = "it does not show what the map has overhead: another level";
  const Eigen::Isometry3d T_map_piece = T_map_key_expected * piece.submap.T_submap_key.inverse();
  return Match{T_map_piece * found->T_a_b * mine.submap.T_submap_key, *std::move(found)};
}

Submap EarlierMap::piece_round(const Eigen::Isometry3d& T_map_key) const {
  Submap piece;
  piece.T_submap_key = upright_from_key(T_map_key);
  const Eigen::Isometry3d T_piece_map = piece.T_submap_key * T_map_key.inverse();
  const auto points = points_near_(T_map_key.translation().head<2>(), config_.piece_radius_m);
  piece.points_submap.reserve(points.size());
  piece.classes.reserve(points.size());
  for (const LabelledPoint& point : points) {
    piece.points_submap.push_back((T_piece_map * point.position_map.cast<double>()).cast<float>());
    piece.classes.push_back(point.label);
  }
  return piece;
}

}  // namespace stillmap
